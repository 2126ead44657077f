"""Rows of pours in unit coordinates."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["Rows"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """Pours, one a row.

    Attributes:
        theta: parameters in [0, 1], shape (n, p).
        condition: inputs in [0, 1], shape (n, q).
        psi: strengths of the effects, shape (n, K).
        x: statistics in their units, shape (n, s).
    """

    theta: Array
    condition: Array
    psi: Array
    x: Array

    def __len__(self) -> int:
        """Returns how many pours these are."""
        return len(self.x)

    @property
    def pour(self) -> NDArray[np.intp]:
        """Number of each row's pour, shape (n,).

        Readings of a pour have its parameters, and no two pours of a continuous prior have the
        same; without parameters each row counts as a pour.
        """
        if self.theta.shape[1] == 0:
            return np.arange(len(self), dtype=np.intp)
        return np.unique(self.theta, axis=0, return_inverse=True)[1].ravel().astype(np.intp)

    def taken(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> "Rows":
        """Returns a copy of some of the rows, by number or by mask."""
        return Rows(self.theta[which], self.condition[which], self.psi[which], self.x[which])

    def wider(self, many: int) -> "Rows":
        """Returns the rows with the strengths of `many` further effects, all 0."""
        psi = np.pad(self.psi, ((0, 0), (0, many)))
        return Rows(self.theta, self.condition, psi, self.x)

    @classmethod
    def joined(cls, parts: Iterable["Rows"]) -> Self:
        """Returns the rows of all parts, one behind the other."""
        parts = list(parts)
        return cls(
            np.concatenate([part.theta for part in parts]),
            np.concatenate([part.condition for part in parts]),
            np.concatenate([part.psi for part in parts]),
            np.concatenate([part.x for part in parts]),
        )
