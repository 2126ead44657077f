"""What one analysis has fixed before it sees a residual, and what runs its pours."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.loop.pours.archive import ArchivePlan
from granulcal.loop.pours.forward import Forward
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.task import FIT, Condition, Task
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["Analysis"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Analysis:
    """The constants of one closing of the loop.

    Attributes:
        task: scene, prior, recordings.
        plan: of the archive.
        forward: runs pours and keeps them.
        rules: thresholds of the verdict.
        seed: of everything.
        say: is told each step.
    """

    task: Task
    plan: ArchivePlan
    forward: Forward
    rules: Thresholds
    seed: int
    say: Callable[[str], None]

    @property
    def fitted(self) -> tuple[Condition, ...]:
        """Conditions to fit."""
        return self.task.of(FIT)

    def measured(self) -> dict[str, Array]:
        """Returns the statistics of the recordings of every condition to fit, by its name."""
        return {c.name: c.statistics(self.task.read_scene) for c in self.fitted}

    def pours(self, condition: Condition, rows: ArrayLike) -> ConditionPours:
        """Returns rows of statistics (n, s) as pours of a condition."""
        at = self.plan.unit(condition.at)
        return ConditionPours.of(condition.name, at, rows, condition.session)

    def observed(self, rows: Mapping[str, ArrayLike]) -> list[ConditionPours]:
        """Returns rows of every condition to fit, by its name, as pours of these conditions."""
        return [self.pours(condition, rows[condition.name]) for condition in self.fitted]
