"""What `close-loop` asks before a word of the fits stands, for a set of `loop_study.py`.

Pours of the base model and of the verdict's at their fits, that hold the surrogate where it is
wrong; a step of the verdict's model by its own pours; whether pours leave anything of the set; what
is left of the word then. Not asked are random draws of the prior, whose pours cost more than all
else, and other definitions, of which the study has none.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop import ConditionPours, Improvement, Surrogate, Thresholds, Trace
from granulcal.loop.analysis import Analysis
from granulcal.loop.check.look_again import Looked, look_again
from granulcal.loop.check.standing import stand
from granulcal.loop.pours.archive import ArchivePlan
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.replicates import error_of
from granulcal.loop.task import FIT, Condition, Task

__all__ = ["Checks"]

Array = NDArray[np.float64]


class Checks:
    """The checks of one study.

    Args:
        plan: of its archive.
        heights: of the conditions to fit [m], by name.
        pours: of a set under each of them.
        forward: pours and keeps.
        rules: thresholds of a verdict.
    """

    def __init__(
        self,
        plan: ArchivePlan,
        heights: dict[str, float],
        pours: int,
        forward: Forward,
        rules: Thresholds,
    ) -> None:
        """States the task that every set of the study is."""
        ((path, _, _),) = plan.conditions
        # A set's pours are at hand: there is nothing to be read.
        conditions = tuple(
            Condition(name, {path: h}, FIT, tuple(Path(name, str(i)) for i in range(pours)))
            for name, h in heights.items()
        )
        self.task = Task(plan.scene, plan.prior, conditions, plan.library)
        self.plan, self.forward, self.rules = plan, forward, rules

    def of(
        self,
        surrogate: Surrogate,
        found: Trace,
        sets: dict[str, Array],
        observed: list[ConditionPours],
        seed: int,
    ) -> tuple[dict[str, Any], Trace]:
        """Returns the word that stands, with the numbers it rests on, and the trace that is held.

        Args:
            surrogate: of the study's archive.
            found: what it says of the set.
            sets: the set's statistics (n, s) by name of the condition.
            observed: the same as the loop sees them.
            seed: of the fresh pours.
        """
        analysis = Analysis(self.task, self.plan, self.forward, self.rules, seed, lambda _: None)
        looked = look_again(analysis, surrogate, found, observed, sets)
        settled, there = looked.settled, looked.placed
        held, of_base, own = there.trace, there.of_base, there.own
        standing = stand(
            held.verdict,
            self.rules,
            confirmed=settled.confirmed,
            anchors=settled.anchors,
            own=own,
            of_base=of_base,
            error=self._error(analysis, sets, looked, seed),
        )
        word: dict[str, Any] = {
            "verdict": standing.verdict.kind,
            "named": standing.verdict.named,
            "families": standing.verdict.families,
            "fits": held.verdict.kind,
            "best": held.best.effects,
            "anchors": settled.anchors,
            "looked": looked.rounds,
            "confirmed": settled.confirmed,
            "own": None if own is None else own.to_dict(),
            "base_p": None if of_base is None else of_base.residual_test.p,
        }
        return word, held

    def _error(
        self, analysis: Analysis, sets: dict[str, Array], looked: Looked, seed: int
    ) -> Improvement | None:
        """The error at the heights to fit before and after; None where too few pours are usable."""
        pours, surrogate = looked.placed.simulated, looked.settled.surrogate
        try:
            return error_of(self.task, analysis.fitted, sets, pours, surrogate, seed)
        except ObservationError:
            return None
