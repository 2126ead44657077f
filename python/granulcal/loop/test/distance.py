r"""How far simulated pours are from measured ones: the paper's error, and one without noise in it.

With statistics over the archive's spread, $y$ measured and $x$ simulated,

$$ E = \overline{\lVert y_j - x_i \rVert}, \qquad
   D^2 = \lVert \bar y - \bar x \rVert^2
   - \sum_i \Big( \frac{s_{y,i}^2}{n_y} + \frac{s_{x,i}^2}{n_x} \Big), \qquad
   R = 1 - D^2_\mathrm{after} / D^2_\mathrm{before} $$

E, the mean over all pairs, holds the noise of two pours; $D^2$ is unbiased for the squared distance
of the means and may be negative; R is the share of it that an effect removed. Intervals: pours are
drawn again within each condition, and the draws are moved so that their mean is the estimate (a
drawn mean has its noise twice). The mean of n pours that are drawn again from n scatters by
$\sqrt{(n - 1) / n}$ of what it should, of two pours by 0.71: they are drawn by so much farther from
their mean. A single measured pour borrows the scatter of the simulated ones.

Reference:
    Matl et al., Inferring the material properties of granular media for robotic tasks, ICRA 2020
    (E). Efron and Tibshirani, An introduction to the bootstrap, 1993, sections 8 and 10. Rao and
    Wu, Resampling inference with complex survey data, JASA 83, 1988 (few draws, rescaled).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError

__all__ = ["Distance", "Improvement", "compare", "drawn_again", "noise_free_square", "pair_error"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Distance:
    """Measured to simulated, one condition or the mean of several.

    Attributes:
        error: E.
        floor: E of a simulated pour to another of the same model: what no model is below.
        square: D^2.
        interval: of D^2 at 95 %.
    """

    error: float
    floor: float
    square: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Improvement:
    """Before and after an effect was added.

    Attributes:
        labels: of the conditions.
        before, after: of each condition.
        total_before, total_after: means over the conditions.
        gain: D^2 before less after, mean over conditions.
        gain_interval: of it at 95 %.
        removed: R of the means; NaN if there was nothing to remove.
        removed_interval: of it at 95 %.
    """

    labels: tuple[str, ...]
    before: tuple[Distance, ...]
    after: tuple[Distance, ...]
    total_before: Distance
    total_after: Distance
    gain: float
    gain_interval: tuple[float, float]
    removed: float
    removed_interval: tuple[float, float]

    @property
    def is_improved(self) -> bool:
        """Whether the gain is above nothing at 97.5 %."""
        return self.gain_interval[0] > 0

    @property
    def is_worse(self) -> bool:
        """Whether the gain is below nothing at 97.5 %."""
        return self.gain_interval[1] < 0

    @property
    def is_at_floor(self) -> bool:
        """Whether nothing may be left."""
        return self.total_after.interval[0] <= 0

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""

        def row(d: Distance) -> dict[str, Any]:
            return {"error": d.error, "floor": d.floor, "square": d.square, "interval": d.interval}

        return {
            "conditions": list(self.labels),
            "before": [row(d) for d in self.before],
            "after": [row(d) for d in self.after],
            "total_before": row(self.total_before),
            "total_after": row(self.total_after),
            "gain": self.gain,
            "gain_interval": self.gain_interval,
            "removed": None if np.isnan(self.removed) else self.removed,
            "removed_interval": [None if np.isnan(r) else r for r in self.removed_interval],
            "is_improved": self.is_improved,
            "is_worse": self.is_worse,
            "is_at_floor": self.is_at_floor,
        }


def pair_error(measured: Array, simulated: Array, spread: Array) -> float:
    """Returns E of pours (n, s) and (k, s); pairs of a pour with itself do not count."""
    gaps = np.linalg.norm((measured[:, None] - simulated[None]) / spread, axis=2)
    if measured is simulated:
        gaps = gaps[~np.eye(len(gaps), dtype=bool)]
    return float(gaps.mean()) if gaps.size else float("nan")


def noise_free_square(measured: Array, simulated: Array, spread: Array) -> float:
    """Returns D^2 of pours (n, s) and (k >= 2, s).

    Raises:
        ObservationError: fewer than two simulated pours.
    """
    if len(simulated) < 2:
        raise ObservationError(f"D^2 needs at least 2 simulated pours, got {len(simulated)}")
    y, x = measured / spread, simulated / spread
    own = x.var(axis=0, ddof=1)
    theirs = y.var(axis=0, ddof=1) if len(y) > 1 else own
    gap = y.mean(axis=0) - x.mean(axis=0)
    return float(gap @ gap - np.sum(theirs / len(y) + own / len(x)))


def drawn_again(
    rows: Array, generator: np.random.Generator, simulated: Array | None = None
) -> Array:
    """Returns pours (n, s) drawn again, their mean as scattered as that of n fresh pours.

    Args:
        rows: the pours; a single one has the scatter of `simulated`.
        generator: of the draws.
        simulated: pours of the same condition, shape (k >= 2, s).
    """
    source = simulated if len(rows) == 1 and simulated is not None else rows
    # Of the draws' own mean they lie nearer than of the truth.
    noise = (source - source.mean(axis=0)) * np.sqrt(len(source) / max(len(source) - 1, 1))
    return rows.mean(axis=0) + noise[generator.integers(len(source), size=len(rows))]


def compare(
    labels: Sequence[str],
    measured: Sequence[Array],
    before: Sequence[Array],
    after: Sequence[Array],
    spread: Array,
    *,
    draws: int = 2000,
    seed: int = 0,
) -> Improvement:
    """Returns distances before and after, each condition's pours of shape (n, s).

    Args:
        labels: of the conditions.
        measured: pours.
        before: simulated pours of the base model.
        after: simulated pours of the augmented model.
        spread: standard deviation of each statistic over the archive, shape (s,).
        draws: of the bootstrap.
        seed: of it.

    Raises:
        ObservationError: conditions that do not match, or fewer than two simulated pours.
    """
    if not len(labels) == len(measured) == len(before) == len(after):
        raise ObservationError(
            f"conditions must match, got {len(labels)} labels, {len(measured)} measured, "
            f"{len(before)} before, {len(after)} after"
        )
    generator = np.random.default_rng(seed)
    sets = (before, after)
    squares = np.array(
        [[noise_free_square(y, x, spread) for y, x in zip(measured, s, strict=True)] for s in sets]
    )
    drawn = np.empty((draws, 2, len(labels)))
    for b in range(draws):
        for h, y in enumerate(measured):
            again = drawn_again(y, generator, before[h])
            for i, simulated in enumerate(sets):
                chosen = drawn_again(simulated[h], generator)
                drawn[b, i, h] = noise_free_square(again, chosen, spread)
    drawn += squares - drawn.mean(axis=0)
    totals, total = drawn.mean(axis=2), squares.mean(axis=1)
    errors = np.array(
        [[pair_error(y, x, spread) for y, x in zip(measured, s, strict=True)] for s in sets]
    )
    floors = np.array([[pair_error(x, x, spread) for x in s] for s in sets])
    each = [
        tuple(
            Distance(errors[i, h], floors[i, h], squares[i, h], _interval(drawn[:, i, h]))
            for h in range(len(labels))
        )
        for i in range(2)
    ]
    whole = [
        Distance(
            float(errors[i].mean()),
            float(floors[i].mean()),
            float(total[i]),
            _interval(totals[:, i]),
        )
        for i in range(2)
    ]
    gains = totals[:, 0] - totals[:, 1]
    is_something = whole[0].interval[0] > 0
    nothing = float("nan")
    shares = 1 - totals[:, 1] / np.where(totals[:, 0] > 0, totals[:, 0], np.nan)
    return Improvement(
        labels=tuple(labels),
        before=each[0],
        after=each[1],
        total_before=whole[0],
        total_after=whole[1],
        gain=float(total[0] - total[1]),
        gain_interval=_interval(gains),
        removed=float(1 - total[1] / total[0]) if is_something else nothing,
        removed_interval=_interval(shares[np.isfinite(shares)])
        if is_something
        else (nothing, nothing),
    )


def _interval(values: Array) -> tuple[float, float]:
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
