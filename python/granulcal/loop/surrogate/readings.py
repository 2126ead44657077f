r"""Readings of one pour share its noise.

A pour whose image is read under several effects is several rows. On an axis, over the scale s,

$$ e_{ir} = \sqrt{\rho}\, a_i + \sqrt{1 - \rho}\, b_{ir}, \qquad a_i, b_{ir} \sim N(0, 1) $$

of reading r of pour i. With Q the reflection that takes $1 / \sqrt n$ to the first of n rows, the
rows $Q e_i$ are independent: the first, $\sqrt n$ times the mean, has the variance $1 - \rho +
n \rho$, the others, contrasts, $1 - \rho$. So n readings know the mean as one pour does, and what
the effects of the image do as well as contrasts tell it. $\rho$ is 1 less the mean square of the
contrasts, over that of all rows.

Reference:
    Fuller and Battese, Transformations for estimation of linear models with nested-error
    structure, JASA 68, 1973.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Readings"]

Array = NDArray[np.float64]

# Contrasts are never taken for noise-free: an effect of the image has noise of its own.
_LARGEST = 0.99
# Residuals beyond this many standard deviations do not say how much is shared.
_HELD = 6.0
# Columns that are turned at a time.
_CHUNK = 256


@dataclass(frozen=True)
class Readings:
    """Which of n rows are of one pour.

    Attributes:
        pour: number of each row's pour, 0 and up without gaps, shape (n,).
        counts: rows of each pour, shape (G,).
    """

    pour: NDArray[np.intp]
    counts: NDArray[np.intp]

    @classmethod
    def of(cls, pour: ArrayLike) -> "Readings":
        """Returns the readings of rows whose pours have any numbers, shape (n,)."""
        _, number, counts = np.unique(np.asarray(pour), return_inverse=True, return_counts=True)
        return cls(number.ravel().astype(np.intp), counts.astype(np.intp))

    @property
    def shares(self) -> Array:
        """One over the readings of each row's pour, shape (n,)."""
        return 1.0 / self.counts[self.pour]

    def apart(self, rows: Array, rho: float, scale: Array | None = None) -> Array:
        """Returns the rows (n, any) or (n,), over a scale (n,), as independent ones of variance 1.

        Many columns are turned a few at a time.
        """
        columns = rows if rows.ndim == 2 else rows[:, None]
        found, spread = np.empty(columns.shape), self._spread(rho)[:, None]
        for start in range(0, columns.shape[1], _CHUNK):
            part = columns[:, start : start + _CHUNK]
            over = part if scale is None else part / scale[:, None]
            found[:, start : start + _CHUNK] = self._turned(over) / spread
        return found.reshape(rows.shape)

    def together(self, rows: Array, rho: float) -> Array:
        """Returns what `apart` was given, of what it returned."""
        return self._turned(rows * self._spread(rho).reshape(-1, *(1,) * (rows.ndim - 1)))

    def shared(self, noise: Array) -> float:
        """Returns rho of the noise of rows (n,), 0 where no pour was read twice."""
        is_contrast = self._is_contrast
        if not is_contrast.any():
            return 0.0
        size = max(float(np.sqrt(np.mean(noise**2))), 1e-300)
        held = np.clip(noise / size, -_HELD, _HELD)
        contrasts = self._turned(held)[is_contrast]
        return float(np.clip(1.0 - np.mean(contrasts**2) / np.mean(held**2), 0.0, _LARGEST))

    @cached_property
    def _is_contrast(self) -> NDArray[np.bool_]:
        """Rows of a pour after its first, shape (n,)."""
        order = np.argsort(self.pour, kind="stable")
        found = np.ones(len(order), dtype=bool)
        found[order[np.cumsum(self.counts) - self.counts]] = False
        return found

    def _spread(self, rho: float) -> Array:
        """Standard deviation of each row after the reflection, shape (n,)."""
        of_mean = np.sqrt(1.0 - rho + self.counts * rho)[self.pour]
        return np.where(self._is_contrast, np.sqrt(1.0 - rho), of_mean)

    def _turned(self, rows: Array) -> Array:
        """Q rows, a copy: of the rows of one pour each; it is its own inverse."""
        found = np.array(rows, dtype=np.float64)
        many = np.nonzero(self.counts[self.pour] > 1)[0]
        if len(many) == 0:
            return found
        many = many[np.argsort(self.pour[many], kind="stable")]
        numbers = self.counts[self.counts > 1]
        starts = np.concatenate([[0], np.cumsum(numbers)[:-1]])
        root = np.sqrt(numbers).reshape(-1, *(1,) * (found.ndim - 1))
        own = found[many]
        first = own[starts]
        along = (np.add.reduceat(own, starts, axis=0) / root - first) / (1.0 - 1.0 / root)
        own -= np.repeat(along / root, numbers, axis=0)
        own[starts] += along
        found[many] = own
        return found
