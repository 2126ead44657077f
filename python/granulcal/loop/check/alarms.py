"""What speaks against a verdict without taking it away: said among its doubts."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.check.standing import Standing
from granulcal.loop.condition import Condition
from granulcal.loop.effects.library import LIBRARY, LibraryEffect
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.replicates import FEWEST
from granulcal.loop.task import Task
from granulcal.loop.test.distance import Improvement, noise_free_square
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Explanation
from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = [
    "of_base_fit",
    "of_ends",
    "of_error",
    "of_exchange",
    "of_labels",
    "of_left",
    "of_placebo",
    "of_prior",
    "of_rows",
    "of_untried",
]

Array = NDArray[np.float64]


# A strength whose best fit is so near to the end of its range leans on it.
_AT_END = 0.02
# Share of a parameter's prior beyond a base fit, on one side, from which it lies at its end.
_BEYOND = 0.01
# Share of D² that must be left once conditions are exchanged for it to be said.
_EXCHANGED = 0.5


def of_placebo(placebo: Verdict, rules: Thresholds) -> tuple[str, ...]:
    """Returns what an alarm says where there is nothing to be found."""
    if placebo.p >= rules.confirm:
        return ()
    return (
        f"the same analysis of as many pours of the base model at its fit says {placebo.kind} (p = "
        f"{placebo.p:.2g}; {placebo.reason}), where there is nothing to be found: the surrogate is "
        "wrong there by as much, and a verdict has to be far more probable than that",
    )


def of_base_fit(verdict: Verdict, at_base: float, rules: Thresholds) -> tuple[str, ...]:
    """Returns what is to be said of an error before that is not of the base model's best fit.

    Args:
        verdict: the word.
        at_base: p of fresh pours of the base model at its fit.
        rules: what was fixed beforehand.
    """
    if verdict.kind not in NAMING or not at_base <= rules.confirm:
        return ()
    return (
        f"the surrogate is wrong at the base model's fit (p = {at_base:.2g} of fresh pours), also "
        "after all rounds that held it there: the base model may be nearer to the data elsewhere, "
        "and what the effect takes away of the error may be less",
    )


def of_error(verdict: Verdict, fit: Improvement, sealed: Improvement | None) -> tuple[str, ...]:
    """Returns what is to be said of a name with which the error grows, or does not fall.

    A fit weighs every direction by its scatter, the error by the spread of the archive: the first
    can fall while the second grows. Where there was no error at the fitted conditions, none can
    fall.
    """
    if verdict.kind not in NAMING:
        return ()
    grown = [
        f"at the {use} conditions from {error.total_before.square:.3g} to "
        f"{error.total_after.square:.3g}"
        for use, error in (("fitted", fit), ("sealed", sealed))
        if error is not None and error.is_worse
    ]
    named = ", ".join(verdict.named)
    before, after = fit.total_before.square, fit.total_after.square
    if not grown and after >= before > 0:
        return (
            f"with {named} the error D² at the fitted conditions is no less than without, "
            f"{after:.3g} after {before:.3g}: what speaks for the name lies in directions that "
            "scatter little, and the name predicts no better there",
        )
    if not grown:
        return ()
    return (
        f"with {named} the error D² grows, {' and '.join(grown)}: what speaks for the name lies in "
        "directions that scatter little",
    )


def of_ends(verdict: Verdict, best: Explanation, task: Task) -> tuple[str, ...]:
    """Returns which numbers of a named model lie at the end of what the library has of them."""
    if verdict.kind not in NAMING or not best.at_end:
        return ()
    found = []
    for name, strength in zip(best.effects, best.best_strengths.tolist(), strict=True):
        if name not in verdict.named or 1.0 - abs(strength) > _AT_END:
            continue
        effect = task.effect(name)
        end = effect.value(math.copysign(1.0, strength))
        unit = "" if effect.unit == "-" else f" {effect.unit}"
        found.append(
            f"{name} is found at {end:.3g}{unit}, the end of what the library has of it: the true "
            "one may lie beyond, and its interval cannot say so"
        )
    return tuple(found)


def of_prior(verdict: Verdict, base: Explanation, task: Task) -> tuple[str, ...]:
    """Returns which parameters of the base model's fit lie at an end of their prior.

    A prior that ends before the truth leaves something as a missing effect does, and an effect that
    does nearly the same takes its place.
    """
    if verdict.kind == "NONE":
        return ()
    found = from_cube(task.prior, base.theta[None])[0].tolist()
    at = [
        f"{name} = {value:.3g}"
        for name, u, value in zip(task.prior.names, base.theta.tolist(), found, strict=True)
        if not _BEYOND < u < 1 - _BEYOND
    ]
    if not at:
        return ()
    return (
        f"the base model's fit lies at an end of its prior, {', '.join(at)}: either what is left "
        "has bent it there, or the true one lies beyond, and what is left is that; ask again with "
        "a wider prior, where the scene takes one",
    )


def of_exchange(
    conditions: Sequence[Condition],
    measured: Mapping[str, Array],
    base: Mapping[str, Array],
    spread: Array,
    errors: Sequence[Improvement | None],
) -> tuple[str, ...]:
    """Returns what `of_labels` says, where the base model leaves an error.

    Sealed conditions are among them: fits follow the recordings that were labelled as others, and
    what they leave is then where nothing was fitted.

    Args:
        conditions: all of a task, those to fit first; of several with the same numbers the first.
        measured: as of `of_labels`, like the rest.
        base: of the base model's pours.
        spread: of the archive.
        errors: at the conditions to fit, and at the sealed ones if there are any.
    """
    if not any(error is not None and error.total_before.interval[0] > 0 for error in errors):
        return ()
    places = [(dict(one.at), dict(one.known)) for one in conditions]
    own = [one.name for i, one in enumerate(conditions) if places[i] not in places[:i]]
    return of_labels({n: measured[n] for n in own}, {n: base[n] for n in own}, spread)


def of_labels(
    measured: Mapping[str, Array], base: Mapping[str, Array], spread: Array
) -> tuple[str, ...]:
    """Returns which conditions have recordings that are nearer to pours of other conditions.

    Args:
        measured: statistics of the pours of each condition, shape (n, s).
        base: of the base model's pours at its fit, by the same names, shape (k, s).
        spread: of the archive, of the first statistics, which are compared, shape (m,).
    """
    from scipy.optimize import linear_sum_assignment

    names = [name for name in measured if len(base[name]) >= FEWEST]
    head = len(spread)
    squares = np.array(
        [
            [noise_free_square(measured[of][:, :head], base[at][:, :head], spread) for at in names]
            for of in names
        ]
    ).reshape(len(names), len(names))
    rows, columns = linear_sum_assignment(squares)
    stated, best = float(np.trace(squares)), float(squares[rows, columns].sum())
    others = [(names[i], names[j]) for i, j in zip(rows, columns, strict=True) if i != j]
    if not others or stated <= 0 or best > _EXCHANGED * stated:
        return ()
    said = ", ".join(f"those of {of} like pours of {at}" for of, at in others)
    return (
        f"recordings look like pours of other conditions, {said} (D² {best:.3g} in all, as stated "
        f"{stated:.3g}): were they exchanged?",
    )


def of_left(
    verdict: Verdict, fit: Improvement, sealed: Improvement | None, *, is_taken_back: bool = False
) -> tuple[str, ...]:
    """Returns where an error is left of a model that is said to explain the pours.

    Args:
        verdict: the word.
        fit: error before and after, conditions to fit.
        sealed: the same of the sealed ones.
        is_taken_back: whether the fits named what the word does not: the error after is of that,
            the word of the base model.
    """
    if verdict.kind not in (*NAMING, "NONE"):
        return ()
    left = [
        f"{label} ({use}): {after.square:.3g}, 95 % {after.interval[0]:.3g} to "
        f"{after.interval[1]:.3g}"
        for use, error in (("fitted", fit), ("sealed", sealed))
        if error is not None
        for label, after in zip(
            error.labels, error.before if is_taken_back else error.after, strict=True
        )
        if after.interval[0] > 0
    ]
    if not left:
        return ()
    model = f"with {', '.join(verdict.named)}" if verdict.named else "of the base model"
    return (
        f"D² {model} is left at {'; at '.join(left)}. {verdict.kind} says that the residual test "
        "finds nothing more, not that the model is right there",
    )


def of_rows(standing: Standing) -> tuple[str, ...]:
    """Returns which rows without physics are nearer to the sealed conditions than a named model."""
    if standing.verdict.kind not in NAMING:
        return ()
    named = ", ".join(standing.verdict.named)
    return tuple(
        f"at the sealed conditions {row.name} is nearer to the measurement than the model with "
        f"{named}: its D² is less by {-row.gain:.3g} (95 %: {-row.gain_interval[1]:.3g} to "
        f"{-row.gain_interval[0]:.3g})"
        for row in standing.trivial
        if row.is_nearer
    )


def of_untried(verdict: Verdict, others: Sequence[LibraryEffect]) -> tuple[str, ...]:
    """Returns which effects of the world were not tried beside a named fault of the measurement.

    What grains do may pass for a fault of their image where it is not among what is tried: pours
    of a soft layer, and of grains of two spheres, were called an offset of the camera.

    Args:
        verdict: the word.
        others: effects that the task leaves out.
    """
    named = [effect for effect in LIBRARY if effect.name in verdict.named]
    if not named or not others or not all(effect.is_of_sight for effect in named):
        return ()
    return (
        f"{', '.join(verdict.named)} is how the grains were seen, chosen among what was tried; "
        f"{', '.join(effect.name for effect in others)} were not, and what grains do may pass for "
        "it: look for it at a thing of known size and place, and name what the grains may have "
        '(effects = ["usual", "clump"])',
    )
