"""What is checked once a verdict stands: its model, its interval, and the correction beside it."""

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.correction import Correction, corrections
from granulcal.loop.check.coverage import Coverage, calibrate
from granulcal.loop.check.prior_pours import PriorPours
from granulcal.loop.check.recentre import Recentred, recentre
from granulcal.loop.check.standing import Moved
from granulcal.loop.check.trivial import Group, TrivialRow, trivial_rows
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.replicates import (
    FEWEST,
    ModelPours,
    seed_under,
    seeds_of_replicates,
)
from granulcal.loop.pours.scenes import faults_of, scene_of
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import FIT, SEALED
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.trace import Explanation, Trace, trace

__all__ = ["calibrated", "corrected", "moved", "nearer", "recentred", "trivial"]

Array = NDArray[np.float64]

# Seeds of pairs, apart from those of the archive and of the replicates; of one pair to the next.
_PAIR_SEED, _PAIR_STEP = 9_000_011, 1000


def recentred(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    one: Explanation,
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
) -> Recentred | None:
    """Returns what pours of a model at its fit say of the data; None where too few are usable.

    The model is that of the verdict, or the base model.
    """
    pours = {
        c.name: simulated[c.name].base if one is found.base else simulated[c.name].augmented
        for c in analysis.fitted
    }
    if min(map(len, pours.values())) < FEWEST:
        return None
    seen, fresh = analysis.observed(measured), analysis.observed(pours)
    fit = found.fit_of(one)
    return recentre(surrogate, fit, seen, fresh, analysis.rules, seed=analysis.seed)


def calibrated(
    analysis: Analysis, surrogate: Surrogate, found: Trace, pairs: int
) -> Coverage | None:
    """Returns the interval of the named effect by simulated pairs; None if none were asked for."""
    best = found.best
    if pairs == 0 or len(best.effects) != 1:
        return None
    (name,) = best.effects
    task, seed = analysis.task, analysis.seed

    def pour(b: int, theta: Array, psi: float) -> list[ConditionPours] | None:
        observed = []
        for condition in analysis.fitted:
            scene = scene_of(task, condition, theta, {name: psi})
            first = _PAIR_SEED + seed_under(condition, seed) + _PAIR_STEP * b
            seeds = range(first, first + len(condition.recordings))
            faults = faults_of(task, {name: psi})
            rows = analysis.forward.limit(scene, seeds, faults, task.coarse)
            if len(rows) == 0:
                return None
            observed.append(analysis.pours(condition, rows))
        return observed

    model = found.model_of(best)
    return calibrate(surrogate, model, pour, analysis.rules, count=pairs, seed=seed)


def corrected(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
) -> tuple[Correction, ...]:
    """Returns what the correction without physics leaves; none where nothing was detected."""
    if found.verdict.kind == "NONE":
        return ()
    measures = Measures.of(analysis.task.scene)
    rows = [
        (c.name, analysis.plan.unit(c.at), measured[c.name], simulated[c.name].base)
        for c in analysis.task.conditions
        if len(simulated[c.name].base) >= FEWEST
    ]
    return corrections(surrogate, found, rows, measures.names[: measures.head])


def moved(analysis: Analysis, surrogate: Surrogate) -> tuple[Moved, ...]:
    """Returns the verdicts of the pours to fit, by every other definition that was declared."""
    found, task = [], analysis.task
    for definition in task.definitions[1:]:
        observed = [
            analysis.pours(c, c.statistics(task.read_scene)) for c in task.under(definition, FIT)
        ]
        there = trace(surrogate, observed, analysis.rules, seed=analysis.seed)
        found.append(Moved(definition.name, there.verdict))
    return tuple(found)


def nearer(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    seen: PriorPours | None,
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
) -> Improvement | None:
    """Returns the error of the best random draw, poured anew (before), and of the fit (after).

    None where nothing was poured of the prior, or too few pours are usable.
    """
    if seen is None:
        return None
    strengths = dict(zip(seen.effects, seen.strengths[0].tolist(), strict=True))
    task, seed = analysis.task, analysis.seed
    size = Measures.of(task.scene).head
    rows = []
    for condition in analysis.fitted:
        scene = scene_of(task, condition, seen.theta[0], strengths)
        seeds, faults = seeds_of_replicates(condition, seed), faults_of(task, strengths)
        x = analysis.forward.limit(scene, seeds, faults, task.coarse)
        at_fit = simulated[condition.name].augmented
        if min(len(x), len(at_fit)) < FEWEST:
            return None
        rows.append((condition.name, measured[condition.name], x, at_fit))
    return compare(
        [name for name, _, _, _ in rows],
        [y[:, :size] for _, y, _, _ in rows],
        [x[:, :size] for _, _, x, _ in rows],
        [x[:, :size] for _, _, _, x in rows],
        surrogate.raw_spread[:size],
        seed=seed,
    )


def trivial(
    analysis: Analysis,
    surrogate: Surrogate,
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
) -> tuple[TrivialRow, ...]:
    """Returns what needs no physics under the sealed conditions; none without any."""
    size = Measures.of(analysis.task.scene).head

    def groups(use: str) -> list[Group]:
        return [
            Group(
                c.name,
                analysis.plan.unit(c.at),
                measured[c.name][:, :size],
                *(rows[:, :size] for rows in simulated[c.name]),
            )
            for c in analysis.task.of(use)
            if min(len(rows) for rows in simulated[c.name]) >= FEWEST
        ]

    spread = surrogate.raw_spread[:size]
    return trivial_rows(groups(FIT), groups(SEALED), spread, seed=analysis.seed)
