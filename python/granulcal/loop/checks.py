"""What is checked once a verdict stands: its model, its interval, and the correction beside it."""

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.archive import Plan
from granulcal.loop.confirm import confirm
from granulcal.loop.correction import Correction, corrections
from granulcal.loop.forward import Forward
from granulcal.loop.measures import Measures
from granulcal.loop.observation import Observation
from granulcal.loop.pairs import Calibrated, calibrate
from granulcal.loop.scenes import faults_of, scene_of
from granulcal.loop.surrogate import Surrogate
from granulcal.loop.task import FIT, Condition, Task
from granulcal.loop.thresholds import Thresholds
from granulcal.loop.trace import Trace

__all__ = ["calibrated", "confirmed", "corrected"]

Array = NDArray[np.float64]

# Fewest pours that have a mean and a scatter.
_FEWEST = 2
# Seeds of pairs, apart from those of the archive and of the replicates; of one pair to the next.
_PAIR_SEED, _PAIR_STEP = 9_000_011, 1000


def confirmed(
    surrogate: Surrogate,
    plan: Plan,
    fitted: tuple[Condition, ...],
    found: Trace,
    simulated: dict[str, tuple[Array, Array]],
) -> float:
    """Returns p of fresh pours of the verdict's model at its fit; NaN where too few are usable."""
    rows = [(c, simulated[c.name][1]) for c in fitted]
    fresh = [Observation.of(c.name, plan.unit(c.at), x) for c, x in rows if len(x) >= _FEWEST]
    return confirm(surrogate, found.fit_of(found.best), fresh) if fresh else float("nan")


def calibrated(
    forward: Forward,
    task: Task,
    plan: Plan,
    surrogate: Surrogate,
    found: Trace,
    rules: Thresholds,
    pairs: int,
    seed: int,
) -> Calibrated | None:
    """Returns the interval of the named effect by simulated pairs; None if none were asked for."""
    best = found.best
    if pairs == 0 or len(best.effects) != 1:
        return None
    (name,) = best.effects

    def pour(b: int, theta: Array, psi: float) -> list[Observation] | None:
        observed = []
        for condition in task.of(FIT):
            scene = scene_of(task, condition, theta, {name: psi})
            first = _PAIR_SEED + seed + _PAIR_STEP * b
            seeds = range(first, first + len(condition.recordings))
            rows = forward.pours(scene, seeds, faults_of(task, {name: psi}))
            if len(rows) == 0:
                return None
            observed.append(Observation.of(condition.name, plan.unit(condition.at), rows))
        return observed

    model = found.model_of(best)
    return calibrate(surrogate, model, pour, rules, count=pairs, seed=seed)


def corrected(
    task: Task,
    plan: Plan,
    surrogate: Surrogate,
    found: Trace,
    measured: dict[str, Array],
    simulated: dict[str, tuple[Array, Array]],
) -> tuple[Correction, ...]:
    """Returns what the correction without physics leaves; none where nothing was detected."""
    if found.verdict.kind == "NONE":
        return ()
    measures = Measures.of(task.scene)
    rows = [
        (c.name, plan.unit(c.at), measured[c.name], simulated[c.name][0])
        for c in task.conditions
        if len(simulated[c.name][0]) >= _FEWEST
    ]
    return corrections(surrogate, found, rows, measures.names[: measures.head])
