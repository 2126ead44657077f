"""What a training run did, and how well the result is calibrated, as numbers."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from granulcal.diagnostics import CoverageCount

__all__ = ["Calibration", "TrainingSummary"]


@dataclass(frozen=True, kw_only=True)
class TrainingSummary:
    """Counts and losses of one training run.

    Attributes:
        status: `diverged` if a member never had a finite validation loss, `stopped_early` if every
            member ran out of patience, else `epoch_limit`.
        pair_count: pairs given, before any was excluded.
        train_count: pairs that each member was trained on.
        validation_count: pairs that decided when each member stopped.
        test_count: pairs kept for the calibration check.
        excluded: number of pairs left out by reason: `unhealthy`, `jammed`,
            `no_grains_in_view`, `non_finite`.
        horizon_count: pairs kept although their simulation ended at its time limit.
        epoch_count: passes over the pairs until the last member stopped.
        best_epochs: pass whose weights were kept, for each member.
        train_losses: mean negative log density of a member's last pass, standardised [nat].
        validation_losses: lowest validation loss of each member, standardised [nat].
        fit_seconds: processor time of the whole fit [s].
        notes: what else a reader should know, for example statistics that never changed.
    """

    status: str
    pair_count: int
    train_count: int
    validation_count: int
    test_count: int
    excluded: dict[str, int]
    horizon_count: int
    epoch_count: int
    best_epochs: tuple[int, ...]
    train_losses: tuple[float, ...]
    validation_losses: tuple[float, ...]
    fit_seconds: float
    notes: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Returns plain values, for JSON; the time is left out so that equal fits are equal.

        JSON has no NaN or infinity: such losses of a diverged member become None.
        """
        values = asdict(self)
        del values["fit_seconds"]
        for name in ("train_losses", "validation_losses"):
            values[name] = [loss if np.isfinite(loss) else None for loss in values[name]]
        return values

    def __str__(self) -> str:
        """The counts in one or two lines."""
        dropped = ", ".join(f"{n} {why}" for why, n in self.excluded.items() if n) or "none"
        lines = [
            f"BayesSim: {self.pair_count} pairs, excluded: {dropped}; "
            f"{self.train_count} train, {self.validation_count} validation, {self.test_count} test",
            f"  {len(self.best_epochs)} member(s), {self.epoch_count} epochs ({self.status}), "
            f"{self.fit_seconds:.1f} s of processor time",
        ]
        if self.horizon_count:
            lines.append(f"  {self.horizon_count} pairs ended at the time limit, kept")
        return "\n".join(lines + [f"  note: {note}" for note in self.notes])


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Check of a model on pairs that it has never seen.

    Attributes:
        test_count: pairs looked at.
        posterior_loss: mean of -log posterior density at the truth, own units [nat].
        prior_loss: mean of -log prior density at the truth, own units [nat].
        coverage: one count for each level.
    """

    test_count: int
    posterior_loss: float
    prior_loss: float
    coverage: tuple[CoverageCount, ...]

    @property
    def is_calibrated(self) -> bool:
        """Whether every count lies in its band; the bands hold jointly at 95 %."""
        return all(count.is_within_band for count in self.coverage)

    def as_dict(self) -> dict[str, Any]:
        """Returns plain values, for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Calibration":
        """Returns what `as_dict` gave."""
        coverage = tuple(CoverageCount(**count) for count in values["coverage"])
        return cls(**{**values, "coverage": coverage})

    def __str__(self) -> str:
        """The check as a few lines; a level outside its band is shouted."""
        gain = self.prior_loss - self.posterior_loss
        lines = [
            f"  calibration on {self.test_count} unseen pairs: -log density at the truth "
            f"{self.posterior_loss:.2f} (prior {self.prior_loss:.2f}, gain {gain:.2f} nat)"
        ]
        for count in self.coverage:
            lines.append(
                f"  {count.level:.0%} region holds {count.inside}/{count.total} truths "
                f"(chance allows {count.low}..{count.high})"
            )
        wrong = [count for count in self.coverage if not count.is_within_band]
        if wrong:
            sides = {"OVERCONFIDENT" if c.inside < c.low else "TOO WIDE" for c in wrong}
            levels = ", ".join(f"{count.level:.0%}" for count in wrong)
            lines.append(f"  !!! NOT CALIBRATED at {levels}: {' and '.join(sorted(sides))} !!!")
        if not np.isfinite(self.posterior_loss) or gain <= 0:
            lines.append("  !!! THE POSTERIOR IS NO BETTER THAN THE PRIOR !!!")
        return "\n".join(lines)
