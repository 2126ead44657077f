"""Pairs of parameters and statistics, checked once and freed of unusable rows."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.arrays import as_matrix
from granulcal.bayessim.check.diagnostics import uniform_p_value
from granulcal.bayessim.named import by_name, names_of, placeholders
from granulcal.errors import TrainingDataError
from granulcal.pours.scene import Scene
from granulcal.pours.status import NO_GRAINS, UNUSABLE, USABLE
from granulcal.prior import Prior

__all__ = ["TrainingPairs"]

Array = NDArray[np.float64]

# A jammed pour is healthy, but no formation: what is learned is p(theta | x, the funnel emptied).
EXCLUDED_STATUSES = (*UNUSABLE, NO_GRAINS)
# Fewer pairs than this cannot be split into training, validation and test.
FEWEST_PAIRS = 50
# Chance that draws of the prior are taken for others, for each parameter.
_UNLIKELY = 1e-4


@dataclass(frozen=True, kw_only=True)
class TrainingPairs:
    """Usable pairs and the count of the others.

    Attributes:
        prior: the prior that the parameters were drawn from.
        theta: parameters, own units, columns as `prior.names`, shape (n, p).
        x: statistics, own units, shape (n, s).
        x_names: names of the statistics.
        pair_count: pairs given.
        excluded: pairs left out by reason.
        horizon_count: kept pairs whose simulation ended at its time limit.
        scene_toml: the scene that the pairs come from, or None.
        law: number of the solver's law that the pours follow, 0 for another simulator, or None.
        not_of_prior: parameters that do not look drawn from the prior in all pairs given, the
            excluded ones too, each with its Kolmogorov-Smirnov p-value.
        without_value: pairs that were left out because a statistic has no value in them, by the
            name of the statistic, the most first.
    """

    prior: Prior
    theta: Array
    x: Array
    x_names: tuple[str, ...]
    pair_count: int
    excluded: dict[str, int]
    horizon_count: int
    scene_toml: str | None
    law: int | None = None
    not_of_prior: dict[str, float] = field(default_factory=dict)
    without_value: dict[str, int] = field(default_factory=dict)

    @classmethod
    def gather(
        cls,
        data_or_theta: Any,
        x: Any = None,
        *,
        prior: Prior | None = None,
        status: Sequence[str] | None = None,
        x_names: Sequence[str] | None = None,
        scene: Any = None,
        proposal: Prior | None = None,
        fewest: int = FEWEST_PAIRS,
    ) -> "TrainingPairs":
        """Returns the usable pairs of a data set, or of two arrays or frames.

        The columns of frames are matched by name: those of the parameters are the prior's free
        ones in any order, those of the statistics are `x_names`, unless others are given. Where
        there is a `proposal`, rows outside of the prior count nothing and are left out.

        Raises:
            TrainingDataError: shapes that do not fit, a status that does not exist, NaN among the
                parameters, parameters outside the prior, no prior, a text that is no scene, or too
                few usable pairs.
            TypeError: an array that does not hold real numbers, or a scene that is no text.
        """
        theta_names, law, scene_toml = None, None, _scene_toml(scene)
        if x is None:
            data = data_or_theta
            for attribute in ("theta", "x"):
                if not hasattr(data, attribute):
                    raise TypeError(
                        "fit takes a data set with attributes theta and x, or theta and x "
                        f"as two arrays; got one {type(data).__name__} without {attribute}"
                        f"{_what_reads(data)}"
                    )
            theta_values, x = data.theta, data.x
            theta_names = getattr(data, "theta_names", None)
            prior = prior if prior is not None else getattr(data, "prior", None)
            status = status if status is not None else getattr(data, "status", None)
            x_names = x_names if x_names is not None else getattr(data, "x_names", None)
            if scene_toml is None:
                scene_toml = getattr(data, "scene_toml", None)
            law = getattr(data, "law", None)
        else:
            theta_values = data_or_theta
        if prior is None:
            raise TrainingDataError("no prior: neither fit(prior=...) nor the data set has one")
        if not isinstance(prior, Prior):
            raise TypeError(f"prior must be a Prior, got {type(prior).__name__}")
        if theta_names is None:
            theta_values = by_name(
                "theta", theta_values, prior.names, whose="the prior", error=TrainingDataError
            )
        theta = _matrix("theta", theta_values)
        theta = theta[:, _columns(theta.shape[1], theta_names, prior)]
        x, x_names = _named(x, x_names)
        statistics = _matrix("x", x)
        if len(theta) != len(statistics):
            raise TrainingDataError(
                f"theta and x must have as many rows, got {len(theta)} and {len(statistics)}"
            )
        names = _statistic_names(x_names, statistics.shape[1])
        statuses = _statuses(status, len(theta))
        excluded = {name: int(np.sum(statuses == name)) for name in EXCLUDED_STATUSES}
        is_healthy = ~np.isin(statuses, EXCLUDED_STATUSES)
        is_finite = np.isfinite(statistics).all(axis=1)
        excluded["non_finite"] = int(np.sum(is_healthy & ~is_finite))
        without_value = _without_value(statistics[is_healthy], names)
        keep = is_healthy & is_finite
        # A pair that is there again would be on both sides of a split.
        is_first = _is_first(np.column_stack([theta, statistics]))
        excluded["repeated"] = int(np.sum(keep & ~is_first))
        # Rows whose pours cannot be used were drawn, too: the others are no draws of the prior.
        # Of several pours of one material that was drawn once.
        not_of_prior = _not_of_prior(theta[_is_first(theta)], prior)
        keep &= is_first
        if proposal is not None:
            is_outside = _is_outside(theta, prior).any(axis=1)
            excluded["outside_prior"] = int(np.sum(keep & is_outside))
            keep &= ~is_outside
        _check_inside(theta[keep], prior)
        if keep.sum() < fewest:
            dropped = [f"{count} {reason}" for reason, count in excluded.items() if count]
            dropped += [f"{count} have no {name}" for name, count in without_value.items()]
            raise TrainingDataError(
                f"at least {fewest} usable pairs are needed, got {int(keep.sum())} "
                f"of {len(theta)} (excluded: {', '.join(dropped) or 'none'})"
            )
        return cls(
            prior=prior,
            theta=theta[keep],
            x=statistics[keep],
            x_names=names,
            pair_count=len(theta),
            excluded=excluded,
            horizon_count=int(np.sum(statuses[keep] == "horizon")),
            scene_toml=scene_toml,
            law=law,
            not_of_prior=not_of_prior,
            without_value=without_value,
        )

    def require_varied(self) -> None:
        """Refuses pairs that say nothing of a parameter.

        Raises:
            TrainingDataError: a parameter is the same in all of them.
        """
        still = [
            n for n, each in zip(self.prior.names, self.theta.T, strict=True) if not np.ptp(each)
        ]
        if still:
            raise TrainingDataError(
                f"theta: {', '.join(still)} is the same in all {len(self.theta)} usable pairs; "
                "nothing can be learnt of it"
            )


def _without_value(statistics: Array, names: Sequence[str]) -> dict[str, int]:
    """Returns how many rows of `statistics` (n, s) lack each statistic that some lack."""
    lacking = np.sum(~np.isfinite(statistics), axis=0)
    found = {name: int(n) for name, n in zip(names, lacking, strict=True) if n}
    return dict(sorted(found.items(), key=lambda each: -each[1]))


def require_same_prior(stated: Prior | None, given: Prior | None) -> None:
    """Refuses a prior that pours were not drawn from.

    Raises:
        TrainingDataError: the data set states another.
    """
    if stated is None or given is None or stated.to_toml() == given.to_toml():
        return
    raise TrainingDataError(
        f"the pours were drawn from another prior than the one given:\n{stated.to_toml().strip()}\n"
        "its posterior would be wrong; leave `prior` out, or say proposal=data.prior so that the "
        "pours are weighted"
    )


def _is_first(rows: Array) -> NDArray[np.bool_]:
    """Returns which rows are the first of their numbers; NaN is like NaN."""
    # Stable: of equal rows the first stays first. np.unique loses a signal in its comparison.
    order = np.lexsort(rows.T[::-1])
    before, after = rows[order[:-1]], rows[order[1:]]
    is_same = (before == after) | (np.isnan(before) & np.isnan(after))
    found = np.ones(len(rows), dtype=bool)
    found[order[1:]] = ~is_same.all(axis=1)
    return found


def _not_of_prior(theta: Array, prior: Prior) -> dict[str, float]:
    """What does not look drawn from the prior, with p-values; NaN is not looked at."""
    found = {}
    for name, shares in zip(prior.names, prior.cdf(theta).T, strict=True):
        known = shares[np.isfinite(shares)]
        p_value = uniform_p_value(known) if len(known) else 1.0
        if p_value < _UNLIKELY:
            found[name] = p_value
    return found


def _named(x: Any, x_names: Sequence[str] | None) -> tuple[Any, Sequence[str] | None]:
    """The statistics and their names; a frame's own where none are given."""
    found = names_of(x)
    if found is None:
        return x, x_names
    names = found if x_names is None else x_names
    if set(found) != set(names):
        return x, names
    return by_name("x", x, names, whose="x_names", error=TrainingDataError), names


def _matrix(name: str, value: Any) -> Array:
    try:
        array = as_matrix(name, value)
    except ValueError as error:
        raise TrainingDataError(str(error)) from None
    if array.shape[1] == 0:
        raise TrainingDataError(f"{name} must have at least one column, got shape {array.shape}")
    return array


def _columns(count: int, theta_names: Sequence[str] | None, prior: Prior) -> list[int]:
    """Columns of the data set that are the prior's free parameters, in the prior's order."""
    if theta_names is None:
        if count != len(prior.names):
            raise TrainingDataError(
                f"theta must have one column for each of {prior.names}, got {count} columns"
            )
        return list(range(count))
    names = list(theta_names)
    if len(names) != count:
        raise TrainingDataError(f"theta has {count} columns but {len(names)} theta_names")
    if fixed := [name for name in prior.fixed if name in names]:
        raise TrainingDataError(f"theta has a column {', '.join(fixed)}, which the prior fixes")
    missing = [name for name in prior.names if name not in names]
    if missing:
        raise TrainingDataError(f"theta has no column {', '.join(missing)}; it has {names}")
    return [names.index(name) for name in prior.names]


def _statistic_names(x_names: Sequence[str] | None, count: int) -> tuple[str, ...]:
    if x_names is None:
        return placeholders(count)
    if len(x_names) != count:
        raise TrainingDataError(f"x has {count} columns but {len(x_names)} x_names")
    names = tuple(str(name) for name in x_names)
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise TrainingDataError(f"x_names must differ, got {', '.join(twice)} more than once")
    return names


def _statuses(status: Sequence[str] | None, count: int) -> NDArray[np.str_]:
    if status is None:
        return np.full(count, "at_rest")
    statuses = np.asarray([str(each) for each in status])
    if len(statuses) != count:
        raise TrainingDataError(f"status must have {count} entries, got {len(statuses)}")
    known = USABLE + EXCLUDED_STATUSES
    unknown = sorted(set(statuses.tolist()) - set(known))
    if unknown:
        raise TrainingDataError(f"unknown status {', '.join(unknown)}; known: {', '.join(known)}")
    return statuses


def _is_outside(theta: Array, prior: Prior) -> NDArray[np.bool_]:
    low, high = prior.bounds.T
    return (theta < low) | (theta > high)


def _check_inside(theta: Array, prior: Prior) -> None:
    is_outside = _is_outside(theta, prior)
    for i, name in enumerate(prior.names):
        bad_count = int(np.sum(~np.isfinite(theta[:, i])))
        if bad_count:
            raise TrainingDataError(f"theta: {name} is NaN or infinite in {bad_count} rows")
        low, high = prior.bounds[i]
        outside = theta[is_outside[:, i], i]
        if len(outside):
            raise TrainingDataError(
                f"theta: {name} must lie in the prior's bounds [{low:g}, {high:g}], "
                f"got {outside[0]:g} ({len(outside)} rows outside)"
            )


def _scene_toml(scene: Any) -> str | None:
    """The text of a scene that was given; what asks the model later reads it as one."""
    if scene is None:
        return None
    if not isinstance(scene, str) and not hasattr(scene, "to_toml"):
        raise TypeError(f"scene must be TOML text or have to_toml(), got {type(scene).__name__}")
    text = scene if isinstance(scene, str) else str(scene.to_toml())
    try:
        Scene.from_toml(text)
    except ValueError as error:
        raise TrainingDataError(f"scene: {error}") from None
    return text


def _what_reads(data: object) -> str:
    """What makes a data set of a path."""
    is_path = isinstance(data, str | PathLike)
    return ": gc.Dataset.load reads what `generate` wrote" if is_path else ""
