"""Check of a fit on pairs left out of it: regions, ranks and balls that hold the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.check.diagnostics import (
    Coverage,
    CoverageCount,
    RankTest,
    Tarp,
    expected_coverage,
    plot_coverage,
    plot_sbc,
    sbc_ranks,
    tarp,
)
from granulcal.prior import Prior
from granulcal.short_names import short_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["Calibration"]

Array = NDArray[np.float64]

# Chance that a right posterior fails any one of the three tests; 5 % that it fails at all.
# Of the points of TARP: one that nobody draws truths with, which would be these points.
_TARP_SEED = 0x7A52_91C4_66E3
_SIGNIFICANCE = 0.05 / 3
_RANK_DRAWS = 200
_OVERCONFIDENT, _TOO_WIDE = "OVERCONFIDENT", "TOO WIDE"
_REMEDY = "remedy: more pours (`generate` goes on where it stopped), or another --method"
_UNTIL_THEN = {
    _OVERCONFIDENT: f"read the intervals as too narrow where it says {_OVERCONFIDENT}",
    _TOO_WIDE: f"intervals hold the truth more often than they say where it says {_TOO_WIDE}",
}


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """Check of a model on pairs, each by a fit that has not seen it.

    Attributes:
        names: paths of the parameters.
        posterior_loss: mean of -log posterior density at the truth, own units [nat].
        prior_loss: mean of -log prior density at the truth, own units [nat].
        posterior_losses: the same of each pair, shape (n,).
        coverage: expected coverage of highest-density regions.
        ranks: simulation-based calibration of each parameter.
        tarp: coverage of balls around draws of the prior.
        chose_form: whether these pairs chose the model's form, too, as those do that are left out
            of an emulator in turn: the check flatters it then.
    """

    names: tuple[str, ...]
    posterior_loss: float
    prior_loss: float
    posterior_losses: Array
    coverage: Coverage
    ranks: RankTest
    tarp: Tarp
    chose_form: bool = False

    @classmethod
    def of(
        cls,
        prior: Prior,
        posteriors: "Sequence[Posterior]",
        truth: Array,
        *,
        draw_count: int,
        chose_form: bool = False,
    ) -> "Calibration":
        """Returns the check of one posterior for each row of `truth` (n, p)."""
        losses = np.array(
            [-p.log_prob(t)[0] for p, t in zip(posteriors, truth, strict=True)], dtype=np.float64
        )
        points = prior.sample(len(truth), seed=_TARP_SEED)
        # One after the other: both look at the same draws.
        coverage = expected_coverage(
            posteriors, truth, draw_count=draw_count, significance=_SIGNIFICANCE
        )
        balls = tarp(
            posteriors, truth, points, draw_count=draw_count, coordinates=prior.to_unconstrained
        )
        return cls(
            names=tuple(prior.names),
            posterior_loss=float(losses.mean()),
            prior_loss=float(-np.mean(prior.log_prob(truth))),
            posterior_losses=losses,
            coverage=coverage,
            ranks=sbc_ranks(posteriors, truth, draw_count=min(_RANK_DRAWS, draw_count)),
            tarp=balls,
            chose_form=chose_form,
        )

    @property
    def test_count(self) -> int:
        """Number of pairs examined."""
        return len(self.posterior_losses)

    @property
    def gain(self) -> float:
        """Information gained over the prior [nat]."""
        return self.prior_loss - self.posterior_loss

    @property
    def failures(self) -> tuple[str, ...]:
        """What is wrong, each in a few words; empty if nothing is."""
        found = []
        if wrong := self._wrong:
            levels = ", ".join(f"{count.level:.0%}" for count in wrong)
            found.append(f"regions at {levels}: {' and '.join(self._sides)}")
        least = _SIGNIFICANCE / len(self.names)
        for name, p_value in zip(self.names, self.ranks.p_values, strict=True):
            if p_value < least:
                found.append(f"ranks of {name} are not uniform (p = {p_value:.2g})")
        if self.tarp.p_value < _SIGNIFICANCE:
            found.append(f"balls around random points (TARP, p = {self.tarp.p_value:.2g})")
        if not np.isfinite(self.posterior_loss) or self.gain <= 0:
            found.append("THE POSTERIOR IS NO BETTER THAN THE PRIOR")
        return tuple(found)

    @property
    def _wrong(self) -> list[CoverageCount]:
        """The levels at which the coverage fails."""
        return [count for count in self.coverage.counts if not count.is_within_band]

    @property
    def _sides(self) -> list[str]:
        """To which sides it fails, in words."""
        return sorted({_OVERCONFIDENT if c.inside < c.low else _TOO_WIDE for c in self._wrong})

    @property
    def is_calibrated(self) -> bool:
        """Whether no test fails; a right posterior passes with a probability of 95 %."""
        return not self.failures

    def as_dict(self) -> dict[str, Any]:
        """Returns plain values, for JSON."""
        return {
            "names": list(self.names),
            "prior_loss": self.prior_loss,
            "posterior_losses": [
                float(x) if np.isfinite(x) else None for x in self.posterior_losses
            ],
            "truth_levels": self.coverage.truth_levels.tolist(),
            "counts": [vars(count) for count in self.coverage.counts],
            "ranks": self.ranks.ranks.tolist(),
            "rank_draws": self.ranks.draw_count,
            "rank_p_values": self.ranks.p_values.tolist(),
            "tarp_shares": self.tarp.shares.tolist(),
            "tarp_p_value": self.tarp.p_value,
            "chose_form": self.chose_form,
        }

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> "Calibration":
        """Returns what `as_dict` gave."""
        losses = np.array([np.inf if x is None else x for x in values["posterior_losses"]])
        counts = tuple(CoverageCount(**count) for count in values["counts"])
        return cls(
            names=tuple(values["names"]),
            posterior_loss=float(losses.mean()),
            prior_loss=values["prior_loss"],
            posterior_losses=losses,
            coverage=Coverage(np.array(values["truth_levels"]), counts),
            ranks=RankTest(
                np.array(values["ranks"], dtype=np.int64),
                values["rank_draws"],
                np.array(values["rank_p_values"]),
            ),
            tarp=Tarp(np.array(values["tarp_shares"]), values["tarp_p_value"]),
            chose_form=values.get("chose_form", False),
        )

    def __str__(self) -> str:
        """The check as a few lines; a failure is shouted and the remedy named."""
        which = ", each by a fit without it" if self.chose_form else " it had not seen"
        lines = [
            f"  checked on {self.test_count} pours{which}: -log density at the truth "
            f"{self.posterior_loss:.2f} (prior {self.prior_loss:.2f}, gain {self.gain:.2f} nat)"
        ]
        if self.chose_form:
            lines.append(
                "  these pours chose the model's form, too, which flatters it: other pours "
                "(`check --data`) are stricter"
            )
        for count in self.coverage.counts:
            lines.append(
                f"  {count.level:.0%} region holds {count.inside}/{count.total} truths "
                f"(chance allows {count.low}..{count.high})"
            )
        shown = ", ".join(
            f"{name} {p:.2g}"
            for name, p in zip(short_names(self.names), self.ranks.p_values, strict=True)
        )
        lines.append(f"  p-values: ranks {shown}; TARP {self.tarp.p_value:.2g}")
        if self.failures:
            lines.append(f"  !!! NOT CALIBRATED: {'; '.join(self.failures)} !!!")
            until_then = " and ".join(_UNTIL_THEN[side] for side in self._sides)
            lines.append(f"  {_REMEDY}{f'; until then {until_then}' if until_then else ''}")
        else:
            lines.append("  calibrated: no test says otherwise (5 % false alarms in all)")
        return "\n".join(lines)

    def plot(self, folder: str | PathLike[str]) -> "list[Figure]":
        """Writes coverage.png and sbc.png into `folder`."""
        from pathlib import Path

        out = Path(folder)
        out.mkdir(parents=True, exist_ok=True)
        short = short_names(self.names)
        return [
            plot_coverage(self.coverage, out / "coverage.png"),
            plot_sbc(self.ranks, out / "sbc.png", names=short),
        ]
