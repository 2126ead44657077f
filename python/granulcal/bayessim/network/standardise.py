"""Brings statistics to mean 0 and spread 1, and remembers the range they were trained on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Standardiser"]

Array = NDArray[np.float64]

# A positive statistic more skewed than an exponential is taken in logarithms if that helps.
_LARGEST_SKEWNESS = 2.0
# Below this share of its own size a spread is round-off, not signal.
_CONSTANT_SPREAD = 1e-9


@dataclass(frozen=True)
class Standardiser:
    """Per statistic: an optional logarithm, then a shift and a scale.

    Attributes:
        is_log: whether the logarithm is taken first, shape (s,).
        shift: mean of the training values, shape (s,).
        scale: standard deviation of the training values, 1 if they never change, shape (s,).
        low: smallest training value, the statistic's own unit, shape (s,).
        high: largest training value, the statistic's own unit, shape (s,).
    """

    is_log: NDArray[np.bool_]
    shift: Array
    scale: Array
    low: Array
    high: Array

    @classmethod
    def fit(cls, x: Array) -> "Standardiser":
        """Returns the standardiser of training statistics `x`, shape (n, s)."""
        low, high = x.min(axis=0), x.max(axis=0)
        skewness = _skewness(x)
        log_skewness = _skewness(_warp(x, low > 0))
        is_log = (low > 0) & (skewness > _LARGEST_SKEWNESS) & (np.abs(log_skewness) < skewness)
        is_still = _is_constant(low, high)
        is_log &= ~is_still
        warped = _warp(x, is_log)
        shift, scale = warped.mean(axis=0), warped.std(axis=0)
        is_constant = scale <= _CONSTANT_SPREAD * np.maximum(np.abs(shift), 1e-300)
        # Exactly, so that nothing is left of what never changed.
        shift = np.where(is_still, 0.5 * (low + high), shift)
        return cls(is_log, shift, np.where(is_constant, 1.0, scale), low, high)

    @property
    def is_constant(self) -> NDArray[np.bool_]:
        """Whether a statistic never changed in training but for round-off, shape (s,)."""
        return _is_constant(self.low, self.high)

    def apply(self, x: Array, *, clip: bool = True) -> Array:
        """Returns standardised statistics (n, s).

        Values beyond the training range are moved to it, unless `clip` is false; a logarithm is
        then still taken of a value no lower than a thousandth of the lowest. What never changed in
        training but for round-off is as it was there if round-off is all that it is off by.
        """
        middle = 0.5 * (self.low + self.high)
        is_still = self.is_constant & (np.abs(x - middle) <= _CONSTANT_SPREAD * np.abs(middle))
        x = np.where(is_still, middle, x)
        low, high = (
            (self.low, self.high) if clip else (self._floor, np.full_like(self.high, np.inf))
        )
        return (_warp(np.clip(x, low, high), self.is_log) - self.shift) / self.scale

    @property
    def _floor(self) -> Array:
        return np.where(self.is_log, 1e-3 * self.low, -np.inf)

    def is_outside(self, x: Array) -> NDArray[np.bool_]:
        """Returns which statistics lie beyond the training range, shape (n, s)."""
        return (x < self.low) | (x > self.high)


def _is_constant(low: Array, high: Array) -> NDArray[np.bool_]:
    return high - low <= _CONSTANT_SPREAD * np.maximum(np.abs(low), np.abs(high))


def _warp(x: Array, is_log: NDArray[np.bool_]) -> Array:
    warped = x.copy()
    warped[:, is_log] = np.log(x[:, is_log])
    return warped


def _skewness(x: Array) -> Array:
    centred = x - x.mean(axis=0)
    spread = np.maximum(x.std(axis=0), 1e-300)
    return np.mean((centred / spread) ** 3, axis=0)
