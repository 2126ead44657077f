"""Pours of the base and of the verdict's model at their fits, and their distance to the data."""

import zlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.scenes import faults_of, scene_of
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import Condition, Task
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.trace import Explanation, Trace
from granulcal.pours.scene import Scene

__all__ = [
    "FEWEST",
    "REPLICATES",
    "ModelPours",
    "both",
    "error_of",
    "model_faults",
    "model_scene",
    "placebo_of",
    "pours_of",
    "seed_under",
    "seeds_of_replicates",
]

Array = NDArray[np.float64]

REPLICATES = 10
"""Simulated pours of each model under each condition."""
FEWEST = 2
"""Fewest of them that say something of an error."""
# Seeds of replicates, apart from those of the archive.
_SEED = 7_000_003
# Those of a condition are apart from those of others by multiples of this.
_OWN, _CONDITIONS = 10**9, 10**6


def seed_under(condition: Condition, seed: int) -> int:
    """Returns a seed of a condition's own.

    The same seed under two conditions begins with the same places of the grains, and what is left
    of them in the statistics (correlations of 0 to 0.6) would count as independent.
    """
    return seed + _OWN * (1 + zlib.crc32(condition.name.encode()) % _CONDITIONS)


def seeds_of_replicates(condition: Condition, seed: int) -> list[int]:
    """Returns the seeds of a model's pours at its fit under a condition."""
    return [_SEED + seed_under(condition, seed) + i for i in range(REPLICATES)]


class ModelPours(NamedTuple):
    """Pours of two models under one condition.

    Attributes:
        base: of the base model, shape (n, s).
        augmented: of the model with the effects that were found, shape (m, s).
    """

    base: Array
    augmented: Array

    @property
    def pours(self) -> int:
        """How many pours these are; one model's are counted once."""
        return len(self.base) + (len(self.augmented) if self.augmented is not self.base else 0)


def model_scene(task: Task, condition: Condition, one: Explanation) -> Scene:
    """Returns the scene of a model at its best fit under a condition."""
    strengths = dict(zip(one.effects, one.best_strengths.tolist(), strict=True))
    return scene_of(task, condition, one.theta, strengths)


def model_faults(task: Task, one: Explanation) -> dict[str, float]:
    """Returns the faults of the image of a model at its best fit, by kind."""
    return faults_of(task, dict(zip(one.effects, one.best_strengths.tolist(), strict=True)))


def pours_of(
    forward: Forward, task: Task, condition: Condition, one: Explanation, seed: int
) -> Array:
    """Returns pours of a model at its best fit under a condition."""
    scene, faults = model_scene(task, condition, one), model_faults(task, one)
    return forward.limit(scene, seeds_of_replicates(condition, seed), faults, task.coarse)


def both(forward: Forward, task: Task, condition: Condition, found: Trace, seed: int) -> ModelPours:
    """Returns pours of the base and of the augmented model under a condition."""
    before = pours_of(forward, task, condition, found.base, seed)
    if found.best is found.base:
        return ModelPours(before, before)
    return ModelPours(before, pours_of(forward, task, condition, found.best, seed))


def placebo_of(
    forward: Forward, task: Task, condition: Condition, found: Trace, seed: int
) -> Array:
    """Returns as many pours of the base model at its fit as were measured."""
    first = _SEED + seed_under(condition, seed) + REPLICATES
    seeds = [first + i for i in range(len(condition.recordings))]
    return forward.limit(model_scene(task, condition, found.base), seeds, None, task.coarse)


def error_of(
    task: Task,
    conditions: tuple[Condition, ...],
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
    surrogate: Surrogate,
    seed: int,
) -> Improvement:
    """Returns the error before and after over the archive's spread.

    Of the paper's 16 statistics, or of all that the scene observes.
    Conditions under which a model's pours jam or leave the view have no error to tell: left out.

    Raises:
        ObservationError: no condition is left.
    """
    size = Measures.of(task.scene).head
    spread = surrogate.raw_spread[:size]
    told = [c for c in conditions if min(len(rows) for rows in simulated[c.name]) >= FEWEST]
    if not told:
        raise ObservationError(
            f"fewer than {FEWEST} of {REPLICATES} pours at the fit are usable under every one of "
            f"{', '.join(c.name for c in conditions)}: grains jam, leave the view or are unhealthy"
        )
    return compare(
        [c.name for c in told],
        [measured[c.name][:, :size] for c in told],
        [simulated[c.name].base[:, :size] for c in told],
        [simulated[c.name].augmented[:, :size] for c in told],
        spread,
        seed=seed,
    )
