r"""What needs no physics: the rows that a named effect has to beat under sealed conditions.

With the measured means $\bar y_h$ under the conditions to fit and the base model's $\bar x_h$,

$$ \hat y_\mathrm{nearest} = \bar y_{h^*}, \qquad \hat y_\mathrm{line} = \sum_h w_h \bar y_h, \qquad
   \hat y_\mathrm{residual} = \bar x_c + \sum_h w_h (\bar y_h - \bar x_h) $$

$w$ are the weights of the straight line between the neighbours of c, which is carried on beyond the
outermost two; with more inputs than one those of the least-squares plane. An input that has one
value in all of them, as those of definitions, is none here. Where the conditions span neither, the
nearest condition has weight 1. $D^2$ of a row is that of `distance.py`: the squared
distance without the noise of $\bar y_c$ and of the row itself.

The last row asks more than it seems: it knows the base model and what was measured, and so all that
an effect could be named from.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.test.distance import drawn_again, noise_free_square

__all__ = ["LINE", "NEAREST", "RESIDUAL", "Group", "TrivialRow", "line_weights", "trivial_rows"]

Array = NDArray[np.float64]

NEAREST, LINE = "nearest condition", "straight line"
RESIDUAL = "base + its own interpolated residual"

_DRAWS = 2000
_SAME = 1e-9


@dataclass(frozen=True)
class Group:
    """Pours under one condition.

    Attributes:
        label: of the condition.
        at: unit coordinates, shape (q,).
        measured: pours, shape (n, s).
        base: simulated pours of the base model, shape (k >= 2, s).
        named: of the verdict's model, shape (k >= 2, s).
    """

    label: str
    at: Array
    measured: Array
    base: Array
    named: Array


@dataclass(frozen=True)
class TrivialRow:
    """One way to predict sealed conditions without the effect.

    Attributes:
        name: `nearest condition`, `straight line` or `base + its own interpolated residual`.
        labels: of the sealed conditions.
        squares: D^2 under each; NaN where the row has nothing to say, shape (S,).
        total: mean of them.
        gain: D^2 of the row less that of the verdict's model, mean over conditions.
        gain_interval: of it at 95 %; above 0 the model beats the row.
    """

    name: str
    labels: tuple[str, ...]
    squares: Array
    total: float
    gain: float
    gain_interval: tuple[float, float]

    @property
    def is_beaten(self) -> bool:
        """Whether the verdict's model is nearer to the measurement, at 97.5 %."""
        return self.gain_interval[0] > 0

    @property
    def is_nearer(self) -> bool:
        """Whether the row is nearer to the measurement than the verdict's model, at 97.5 %."""
        return self.gain_interval[1] < 0

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "name": self.name,
            "conditions": list(self.labels),
            "squares": self.squares.tolist(),
            "total": self.total,
            "gain": self.gain,
            "gain_interval": list(self.gain_interval),
            "is_beaten": self.is_beaten,
            "is_nearer": self.is_nearer,
        }


def line_weights(known: Array, at: Array) -> Array | None:
    """Returns the weights (H,) of a straight line through `known` (H, q) at `at` (q,).

    None where the conditions do not span one: fewer than two places, or fewer than q + 1 of them
    in general position, q being the inputs in which they or c differ.
    """
    differs = np.any(np.abs(known - at) > _SAME, axis=0)
    if differs.any():
        known, at = known[:, differs], at[differs]
    if known.shape[1] == 1:
        places, index = np.unique(known[:, 0], return_inverse=True)
        if len(places) < 2:
            return None
        i = int(np.clip(np.searchsorted(places, at[0]) - 1, 0, len(places) - 2))
        share = (at[0] - places[i]) / (places[i + 1] - places[i])
        weights = np.zeros(len(known))
        for place, part in ((i, 1 - share), (i + 1, share)):
            weights[index == place] = part / np.sum(index == place)
        return weights
    columns = np.column_stack([np.ones(len(known)), known])
    if np.linalg.matrix_rank(columns, tol=1e-6) < columns.shape[1]:
        return None
    weights = np.linalg.pinv(columns).T @ np.concatenate([[1.0], at])
    return np.asarray(weights, dtype=np.float64)


def nearest_weights(known: Array, at: Array) -> Array:
    """Returns weight 1 (H,) shared by the conditions of `known` (H, q) nearest to `at` (q,)."""
    gaps = np.sum((known - at) ** 2, axis=1)
    nearest = gaps <= gaps.min() + _SAME
    return np.asarray(nearest / nearest.sum(), dtype=np.float64)


def trivial_rows(
    fitted: Sequence[Group],
    sealed: Sequence[Group],
    spread: Array,
    *,
    draws: int = _DRAWS,
    seed: int = 0,
) -> tuple[TrivialRow, ...]:
    """Returns the rows under the sealed conditions; none without any.

    Args:
        fitted: what the rows may know.
        sealed: what they predict.
        spread: standard deviation of each statistic over the archive, shape (s,).
        draws: of the bootstrap.
        seed: of it.
    """
    if not fitted or not sealed:
        return ()
    known = np.array([group.at for group in fitted])
    rows = []
    for name in (NEAREST, LINE, RESIDUAL):
        weights = []
        for group in sealed:
            line, near = line_weights(known, group.at), nearest_weights(known, group.at)
            spans = line if line is not None else near
            weights.append({NEAREST: near, LINE: line, RESIDUAL: spans}[name])
        if any(w is None for w in weights):
            continue
        rows.append(
            _row(
                name,
                fitted,
                sealed,
                [w for w in weights if w is not None],
                spread,
                draws,
                np.random.default_rng(seed),
            )
        )
    return tuple(rows)


def _row(
    name: str,
    fitted: Sequence[Group],
    sealed: Sequence[Group],
    weights: Sequence[Array],
    spread: Array,
    draws: int,
    generator: np.random.Generator,
) -> TrivialRow:
    has_base = name == RESIDUAL
    squares = np.array(
        [
            _square(fitted, group, w, spread, has_base)
            for group, w in zip(sealed, weights, strict=True)
        ]
    )
    own = np.array([noise_free_square(g.measured, g.named, spread) for g in sealed])
    drawn = np.empty(draws)
    for b in range(draws):
        again = [_again(g, generator) for g in fitted]
        gain = 0.0
        for group, w in zip(sealed, weights, strict=True):
            seen = _again(group, generator)
            y = seen.measured.mean(axis=0)
            gain += float(np.sum(((y - _predicted(again, seen, w, has_base)) / spread) ** 2))
            gain -= float(np.sum(((y - seen.named.mean(axis=0)) / spread) ** 2))
        drawn[b] = gain / len(sealed)
    gain = float(squares.mean() - own.mean())
    # A drawn mean has its noise twice: the draws are moved to the estimate.
    low, high = np.quantile(drawn - drawn.mean() + gain, [0.025, 0.975])
    labels = tuple(group.label for group in sealed)
    return TrivialRow(name, labels, squares, float(squares.mean()), gain, (float(low), float(high)))


def _predicted(fitted: Sequence[Group], group: Group, weights: Array, has_base: bool) -> Array:
    known = np.array([g.measured.mean(axis=0) for g in fitted])
    if not has_base:
        return weights @ known
    plain = np.array([g.base.mean(axis=0) for g in fitted])
    return group.base.mean(axis=0) + weights @ (known - plain)


def _square(
    fitted: Sequence[Group], group: Group, weights: Array, spread: Array, has_base: bool
) -> float:
    gap = (group.measured.mean(axis=0) - _predicted(fitted, group, weights, has_base)) / spread
    noise = _noise(group.measured, group.base)
    noise = noise + sum(
        w**2 * _noise(g.measured, g.base) for w, g in zip(weights, fitted, strict=True)
    )
    if has_base:
        noise = noise + _noise(group.base, group.base)
        noise = noise + sum(
            w**2 * _noise(g.base, g.base) for w, g in zip(weights, fitted, strict=True)
        )
    return float(gap @ gap - np.sum(noise / spread**2))


def _noise(rows: Array, simulated: Array) -> Array:
    """Variance of the mean of `rows` (n, s); a single pour borrows that of simulated ones."""
    return (rows if len(rows) > 1 else simulated).var(axis=0, ddof=1) / len(rows)


def _again(group: Group, generator: np.random.Generator) -> Group:
    """The same condition with its pours drawn again."""
    measured = drawn_again(group.measured, generator, group.base)
    base, named = drawn_again(group.base, generator), drawn_again(group.named, generator)
    return Group(group.label, group.at, measured, base, named)
