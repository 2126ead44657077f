"""What a closed loop has found."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.check.correction import Correction
from granulcal.loop.check.coverage import Coverage
from granulcal.loop.check.standing import Standing
from granulcal.loop.check.unseen import Seen
from granulcal.loop.experiment import Experiment
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.replicates import ModelPours, model_faults, model_scene
from granulcal.loop.task import Condition, Task
from granulcal.loop.test.distance import Improvement
from granulcal.loop.test.trace import Explanation, Power, Trace
from granulcal.loop.test.verdict import Verdict
from granulcal.pours.scene import Scene

__all__ = ["Closed"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Closed:
    """What the loop found.

    Attributes:
        task: what was asked.
        standing: the verdict, and what may have overturned that of the fits.
        trace: fit, residual test, refits and verdict on the conditions to fit.
        power: what could be seen, before the data.
        fit: error before and after, conditions to fit.
        sealed: the same of the sealed conditions; None without any.
        placebo: the same pipeline on pours of the base model at its fit.
        experiments: which further pours would tell most.
        pours: that this analysis needed: archive, replicates, placebo.
        registration: SHA-256 of what was fixed beforehand.
        measured: statistics of every condition's pours, by name.
        simulated: of the base and of the augmented model, by condition's name.
        corrections: what the correction without physics leaves; none where nothing was detected.
        calibrated: the interval of the named effect's strength by simulated pairs; None without.
        doubts: what makes recordings or the verdict doubtful, a sentence each.
        seen: what the archive has of each effect.
    """

    task: Task
    standing: Standing
    trace: Trace
    power: Power
    fit: Improvement
    sealed: Improvement | None
    placebo: Trace
    experiments: tuple[Experiment, ...]
    pours: int
    registration: str
    measured: dict[str, Array]
    simulated: dict[str, ModelPours]
    corrections: tuple[Correction, ...] = ()
    calibrated: Coverage | None = None
    doubts: tuple[str, ...] = ()
    seen: tuple[Seen, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """What may be said, once the checks are through."""
        return self.standing.verdict

    def scene(self, condition: Condition, one: Explanation) -> Scene:
        """Returns the scene of a model at its best fit under a condition."""
        return model_scene(self.task, condition, one)

    def faults(self, one: Explanation) -> dict[str, float]:
        """Returns the faults of the image of a model at its best fit, by kind."""
        return model_faults(self.task, one)

    def parameters(self) -> dict[str, dict[str, float]]:
        """Returns the parameters before and after, in their own units.

        How far the missing effect had bent them.
        """
        prior = self.task.prior
        before = from_cube(prior, self.trace.base.theta[None])[0]
        after = from_cube(prior, self.trace.best.theta[None])[0]
        return {
            name: {"before": float(b), "after": float(a)}
            for name, b, a in zip(prior.names, before, after, strict=True)
        }

    def strengths(self) -> dict[str, tuple[float, float, float]]:
        """Low, middle and high of each named effect's number, in the scene's unit.

        Of the verdict's model they are those that its own pours at the fit give; of the effect that
        simulated pairs were poured for the interval is theirs.
        """
        found: dict[str, tuple[float, float, float]] = {}
        own, best = self.standing.own, self.trace.best
        # A pair may be more probable than the effect of it that is named, and has another strength.
        others = sorted(
            self.trace.explanations, key=lambda one: (one is not best, len(one.effects))
        )
        for one in others:
            strengths, intervals = one.strengths, one.intervals
            if one is best and own is not None:
                strengths, intervals = own.strengths, own.intervals
            for name, middle, (low, high) in zip(one.effects, strengths, intervals, strict=True):
                if one is best and self.calibrated is not None:
                    low, high = self.calibrated.interval
                if name in self.trace.verdict.named and name not in found:
                    effect = self.task.effect(name)
                    if not effect.camera:
                        ends = sorted((effect.value(low), effect.value(high)))
                        found[name] = (ends[0], effect.value(middle), ends[1])
        return found

    def to_dict(self) -> dict[str, Any]:
        """Returns everything for JSON."""
        verdict = self.verdict

        def squares(improvement: Improvement | None) -> dict[str, float] | None:
            if improvement is None:
                return None
            before, after = improvement.total_before, improvement.total_after
            return {"before": before.square, "after": after.square}

        return {
            "verdict": verdict.kind,
            "named": list(verdict.named),
            "families": list(verdict.families),
            "p": verdict.p,
            "reason": verdict.reason,
            "doubts": list(self.doubts),
            "strength": self.strengths(),
            "misfit": {"fit": squares(self.fit), "sealed": squares(self.sealed)},
            **self.standing.to_dict(),
            "calibrated": None if self.calibrated is None else self.calibrated.to_dict(),
            "correction": [one.to_dict() for one in self.corrections],
            "pours": self.pours,
            "archive": [one.to_dict() for one in self.seen],
            "not_tried": [effect.name for effect in self.task.untried],
            "placebo": {"verdict": self.placebo.verdict.kind, "p": self.placebo.verdict.p},
            "registration_sha256": self.registration,
            "fit": self.fit.to_dict(),
            "sealed": None if self.sealed is None else self.sealed.to_dict(),
            "parameters": self.parameters(),
            "next_experiments": [one.to_dict() for one in self.experiments],
            "power_before_data": self.power.to_dict(),
            "trace": self.trace.to_dict(),
        }
