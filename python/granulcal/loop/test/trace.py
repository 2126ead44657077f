"""The whole loop on one set of measured pours: fit, residual test, refits, adequacy, verdict."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.loop.effects.design import Design, cube_from_normal, normal_from_cube
from granulcal.loop.surrogate.baseline import Fit, Start, summarise
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.base_test import base_test
from granulcal.loop.test.detectable import detectable, distances
from granulcal.loop.test.refit import Model, by_probability, fit_none, fit_pair, fit_single
from granulcal.loop.test.residual_test import ResidualTest, residual_test
from granulcal.loop.test.score import Scores, families
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import NAMING, Verdict, decide
from granulcal.one_thread import one_thread
from granulcal.progress import steps

__all__ = ["Explanation", "Power", "Trace", "power", "trace"]

Array = NDArray[np.float64]

# Models whose log probability is this far below the best need no test of what they leave [nat].
_HOPELESS = 12.0
# Effects named beside a residual.
_NEAREST = 3
# Of which the table before any data says what is seen.
_MATERIALS = 5


@dataclass(frozen=True)
class Power:
    """What an experiment could see, before its data are seen.

    Attributes:
        effects: names of the candidates, K of them.
        kappa: share of each that theta cannot mimic; NaN if too weak to say.
        detectable: strength from which on each is seen in 80 %, in units of its prior's upper end;
            infinite if it is not at any (`detectable.py`).
        cosines: c, shape (K, K).
        families: groups of parallel effects.
    """

    effects: tuple[str, ...]
    kappa: Array
    detectable: Array
    cosines: Array
    families: tuple[tuple[str, ...], ...]

    @classmethod
    def of(cls, design: Design, scores: Scores, found: Array) -> "Power":
        """Returns the table of scores at a fit, and of distances (M, K, 2, S) of materials."""
        names = tuple(design.effects[k].name for k in scores.effects)
        least = detectable(found, scores.two_sided)
        return cls(names, scores.kappa, least, scores.cosines, _families(design, scores))

    @property
    def shown(self) -> Array:
        """The strengths that may be told: NaN where the effect's direction is not known, (K,)."""
        return np.where(np.isnan(self.kappa), np.nan, self.detectable)

    def to_dict(self) -> dict[str, Any]:
        """Returns the table for JSON; what is not known is None."""
        return {
            "effects": list(self.effects),
            "kappa": [None if np.isnan(k) else float(k) for k in self.kappa],
            "detectable_strength": [float(d) if np.isfinite(d) else None for d in self.shown],
            "cosines": self.cosines.tolist(),
            "families": [list(group) for group in self.families],
        }


@dataclass(frozen=True)
class Explanation:
    """One model and what it leaves.

    Attributes:
        effects: names.
        theta: best parameters, unit coordinates, shape (p,).
        strengths: posterior means, shape (|A|,).
        intervals: shape (|A|, 2).
        best_strengths: at the best fit, shape (|A|,).
        log_probability: relative to the model without effects [nat].
        p_after: of the residual test after its fit; NaN if it was too improbable to be tested.
        at_end: whether a strength leans on the end of its prior.
    """

    effects: tuple[str, ...]
    theta: Array
    strengths: Array
    intervals: Array
    best_strengths: Array
    log_probability: float
    p_after: float
    at_end: bool

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "effects": list(self.effects),
            "theta": self.theta.tolist(),
            "strengths": self.strengths.tolist(),
            "intervals": self.intervals.tolist(),
            "best_strengths": self.best_strengths.tolist(),
            "log_probability": self.log_probability,
            "p_after": None if np.isnan(self.p_after) else self.p_after,
            "at_end": self.at_end,
        }


@dataclass(frozen=True)
class Trace:
    """Everything that a report shows.

    Attributes:
        verdict: the word.
        base: the model without effects; its p_after is that of the residual test.
        explanations: fitted models, most probable first; empty if the residual test did not reject.
        residual_test: the test of the base fit.
        families: groups of candidates that are parallel at the base fit.
        labels: of the conditions, H of them.
        statistics: names, m of them.
        residuals: of the base fit in standard deviations of its covariance, shape (H, m).
        beyond: statistics that no pour of the archive comes near, with condition and values.
        nearest: effects whose directions are nearest to the residual, and the cosine of each.
        thresholds: what was fixed beforehand.
        seed: of all random numbers.
        theta_sd: standard deviations of theta's z-scores at the base fit, shape (p,).
        models: the models themselves, in the order of `explanations` (not in the JSON).
        base_fit: the fit without effects (not in the JSON).
        local: the surrogate at the conditions (not in the JSON).
    """

    verdict: Verdict
    base: Explanation
    explanations: tuple[Explanation, ...]
    residual_test: ResidualTest
    families: tuple[tuple[str, ...], ...]
    labels: tuple[str, ...]
    statistics: tuple[str, ...]
    residuals: Array
    beyond: tuple[str, ...]
    nearest: tuple[tuple[str, float], ...]
    thresholds: Thresholds
    seed: int
    theta_sd: Array
    models: tuple[Model, ...]
    base_fit: Fit
    local: LinearisedSurrogate

    @cached_property
    def power(self) -> Power:
        """Kappa, confusion and detectable strengths at the base fit."""
        return power_at(self.local.surrogate.design, [(self.local, self.base_fit)])

    @property
    def best(self) -> Explanation:
        """The explanation that the verdict rests on, or the base model."""
        if self.verdict.kind in NAMING:
            first, is_set = self.verdict.named[0], self.verdict.kind == "SET"
            for one in self.explanations:
                if is_set and len(one.effects) > 1:
                    # Each of a set by itself; a pair of two of them gave way.
                    continue
                if first in one.effects and set(one.effects) <= set(self.verdict.named):
                    return one
        return self.base

    def model_of(self, one: Explanation) -> Model:
        """Returns the model of an explanation."""
        return self.models[self.explanations.index(one)]

    def fit_of(self, one: Explanation) -> Fit:
        """Returns the fit of the base model or of an explanation."""
        return self.base_fit if one is self.base else self.model_of(one).fit

    def residuals_of(self, one: Explanation) -> Array:
        """Returns what a model leaves, in standard deviations of its covariance, shape (H, m)."""
        return _residuals(self.local, self.fit_of(one))

    def to_dict(self) -> dict[str, Any]:
        """Returns everything for JSON."""
        test, design = self.residual_test, self.local.surrogate.design
        return {
            "verdict": {
                "kind": self.verdict.kind,
                "named": list(self.verdict.named),
                "families": list(self.verdict.families),
                "p": self.verdict.p,
                "reason": self.verdict.reason,
            },
            "residual_test": {
                "p": test.p,
                "p_library": test.p_library,
                "p_any": test.p_any,
                "p_smooth": test.p_smooth,
                "bartlett": test.factors.tolist(),
                "effects": [design.effects[k].name for k in test.effects],
                "squares": test.squares.tolist(),
                "one_step_strengths": test.strengths.tolist(),
                "adjusted_p": test.adjusted.tolist(),
            },
            "base": self.base.to_dict(),
            "theta_sd": self.theta_sd.tolist(),
            "explanations": [one.to_dict() for one in self.explanations],
            "power": self.power.to_dict(),
            "conditions": list(self.labels),
            "statistics": list(self.statistics),
            "residuals": self.residuals.tolist(),
            "beyond_the_archive": list(self.beyond),
            "nearest_effects": [{"name": n, "cosine": c} for n, c in self.nearest],
            "thresholds": self.thresholds.to_dict(),
            "seed": self.seed,
        }


@one_thread()
def trace(
    surrogate: Surrogate,
    observations: Sequence[ConditionPours],
    thresholds: Thresholds | None = None,
    *,
    seed: int = 0,
    starts: Sequence[Start] = (),
) -> Trace:
    """Returns what measured pours say of the library.

    Args:
        surrogate: of the archive.
        observations: pours of the fit conditions; sealed ones must not be among them.
        thresholds: fixed beforehand.
        seed: of starts and replicates.
        starts: where fits begin as well, for example the best of pours of the prior.

    Raises:
        ObservationError: pours or conditions that do not fit the archive.
    """
    rules = thresholds or Thresholds()
    design = surrogate.design
    stack = StackedMeans.of(surrogate, observations)
    target = stack.means.ravel()
    base = base_test(surrogate, stack, rules, seed, starts)
    local, fit, scores, test = base.local, base.fit, base.scores, base.test
    none = fit_none(fit, rules)
    tested: list[tuple[Model, float]] = []
    if test.p <= rules.name and design.candidates:
        tested = _models(local, target, fit, rules, seed, starts)
    merged = families(scores)
    verdict = decide(design, test, none, tested, rules, merged)
    explained = sorted(tested, key=lambda pair: -pair[0].log_probability)
    normal = scores.slopes.T @ scores.slopes + np.eye(len(fit.v))
    return Trace(
        verdict=verdict,
        base=_explain(surrogate, none, none, test.p),
        explanations=tuple(_explain(surrogate, m, none, p) for m, p in explained),
        residual_test=test,
        families=_families(design, scores),
        labels=stack.labels,
        statistics=surrogate.names,
        residuals=_residuals(local, fit),
        beyond=surrogate.beyond(observations),
        nearest=_nearest(surrogate, scores, fit),
        thresholds=rules,
        seed=seed,
        theta_sd=np.sqrt(np.diag(np.linalg.inv(normal))),
        models=tuple(m for m, _ in explained),
        base_fit=fit,
        local=local,
    )


def _nearest(surrogate: Surrogate, scores: Scores, fit: Fit) -> tuple[tuple[str, float], ...]:
    """The largest cosines of effects with the efficient residual, `sqrt(T_k / Q)`."""
    residual = scores.whiten @ fit.residual
    whole = max(float(residual @ residual), 1e-300)
    cosines = np.sqrt(scores.squares(residual[:, None])[:, 0] / whole)
    order = np.argsort(-cosines)[:_NEAREST]
    names = [surrogate.design.effects[k].name for k in scores.effects]
    return tuple((names[i], float(cosines[i])) for i in order)


def _residuals(local: LinearisedSurrogate, fit: Fit) -> Array:
    spread = np.sqrt(np.sum(local.in_statistics(fit.root) ** 2, axis=1))
    return (local.in_statistics(fit.residual) / spread).reshape(len(local.counts), -1)


@one_thread()
def power(
    surrogate: Surrogate,
    theta: ArrayLike,
    conditions: ArrayLike,
    counts: ArrayLike,
    sessions: NDArray[np.int64] | None = None,
) -> Power:
    """Returns what pours could see.

    Args:
        surrogate: of the archive.
        theta: where kappa and the cosines are taken, shape (p,); strengths are seen in 80 % of
            experiments there and with other materials of the prior.
        conditions: unit coordinates, shape (H, q).
        counts: pours of each, shape (H,).
        sessions: number of the session of each, shape (H,); None: each has its own.
    """
    first = np.asarray(theta, dtype=np.float64)
    others = np.random.default_rng(0).random((_MATERIALS - 1, len(first)))
    each = np.asarray(counts, dtype=np.float64)
    # Repeats of one condition have no inputs: (H, 0) is what no -1 can stand for.
    where = np.asarray(conditions, dtype=np.float64)
    where = where.reshape(len(each), len(surrogate.design.conditions))
    places = list(normal_from_cube(np.vstack([first, others])))

    def around(v: Array) -> tuple[LinearisedSurrogate, Fit]:
        """The surrogate there, and its fit; each takes tens of megabytes."""
        local = LinearisedSurrogate.at(surrogate, where, each, v, sessions)
        return local, fit_at(local, v)

    return power_at(surrogate.design, map(around, steps("materials", places)))


@one_thread()
def power_at(design: Design, places: Iterable[tuple[LinearisedSurrogate, Fit]]) -> Power:
    """Returns what pours could see of materials, kappa and the cosines those of the first.

    Places may come one after the other: none is kept.
    """
    scores, found = None, []
    for local, fit in places:
        found.append(distances(local, fit, design.candidates))
        if scores is None:
            scores = Scores.of(local, fit, design.candidates)
    assert scores is not None, "no material"
    return Power.of(design, scores, np.array(found))


def _families(design: Design, scores: Scores) -> tuple[tuple[str, ...], ...]:
    return tuple(tuple(design.effects[k].name for k in group) for group in families(scores))


def fit_at(local: LinearisedSurrogate, v: Array) -> Fit:
    """Returns the fit of data that are the surrogate's mean at `v` (p,)."""
    return summarise(local, local.mean(v, local.none()), v, local.none(), ())


def _models(
    local: LinearisedSurrogate,
    target: Array,
    base: Fit,
    rules: Thresholds,
    seed: int,
    starts: Sequence[Start] = (),
) -> list[tuple[Model, float]]:
    """All singles, pairs if no single is adequate, each with the p of what it leaves."""
    candidates = local.surrogate.design.candidates
    singles = [
        fit_single(local, target, base, k, rules, starts) for k in steps("effects", candidates)
    ]
    singles.sort(key=by_probability, reverse=True)
    best = singles[0].log_probability
    tested = [
        (m, _after(local, m, rules, seed) if m.log_probability > best - _HOPELESS else np.nan)
        for m in singles
    ]
    adequate = [m for m, p in tested if p > rules.adequate]
    if adequate and adequate[0].log_probability > best - rules.rivals:
        return tested
    alone = {model.effects[0]: model for model in singles}
    # Two effects may hide each other so well that neither explains much alone: all are fitted, each
    # pair from its more probable member.
    two = [(min(k, other), max(k, other)) for k, other in combinations(alone, 2)]
    pairs = [
        fit_pair(
            local,
            target,
            base,
            max(alone[k], alone[other], key=by_probability).fit,
            (k, other),
            rules,
        )
        for k, other in steps("pairs", two[: rules.pairs])
    ]
    best = max(model.log_probability for model in [*singles, *pairs])
    near = sorted((m for m in pairs if m.log_probability > best - _HOPELESS), key=by_probability)
    return tested + [(m, _after(local, m, rules, seed)) for m in reversed(near)]


def _after(local: LinearisedSurrogate, model: Model, rules: Thresholds, seed: int) -> float:
    rest = tuple(k for k in local.surrogate.design.candidates if k not in model.effects)
    scores = Scores.of(local, model.fit, rest)
    test = residual_test(
        local,
        model.fit,
        scores,
        replicates=rules.replicates_after,
        refits=rules.refits // 4,
        seed=seed + 1,
    )
    return test.p


def _explain(surrogate: Surrogate, model: Model, none: Model, p: float) -> Explanation:
    return Explanation(
        effects=tuple(surrogate.design.effects[k].name for k in model.effects),
        theta=cube_from_normal(model.fit.v),
        strengths=model.strengths,
        intervals=model.intervals,
        best_strengths=model.fit.psi[list(model.effects)],
        log_probability=model.log_probability - none.log_probability,
        p_after=p,
        at_end=model.at_end,
    )
