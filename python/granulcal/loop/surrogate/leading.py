r"""Features of $f_0$: a polynomial and the leading eigenfunctions of a Matern kernel.

The kernel is that of many random frequencies, $k(u, u') = w(u)^T w(u')$ with F cosines and F sines
in w. Over the cube few directions of w carry all but a thousandth of its variance:

$$ \int w w^T du = E \Lambda E^T, \qquad \varphi = E_r^T w, \qquad
   \textstyle\sum_{i \le r} \Lambda_i \ge (1 - 10^{-3}) \sum_i \Lambda_i $$

E is orthonormal, so that coefficients keep their prior, equal and independent. As many random
frequencies as there are numbers here would be a kernel of their own: a function that they cannot
follow is off by more than their posterior says (`docs/theory/loop.md`).

Reference:
    Rasmussen and Williams, Gaussian Processes for Machine Learning, 2006, section 4.3.
    Rahimi and Recht, Random features for large-scale kernel machines, NIPS 2007.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.basis import Basis

__all__ = ["LeadingBasis"]

Array = NDArray[np.float64]

_FREQUENCIES = 512
_POINTS = 4096
_SHARE = 1e-3


@dataclass(frozen=True)
class LeadingBasis:
    """Features of coordinates in the unit cube.

    Attributes:
        basis: the polynomial and all waves.
        turn: E_r, shape (2 F, r).
    """

    basis: Basis
    turn: Array

    @classmethod
    def draw(cls, u: Array, length_scales: Array, *, most: int, seed: int) -> "LeadingBasis":
        """Returns a basis for coordinates like `u` (n, p), length scales in their spreads.

        Args:
            u: rows whose spread scales the coordinates, shape (n, p).
            length_scales: of the kernel, shape (p,).
            most: largest number of eigenfunctions.
            seed: seed of frequencies and points.
        """
        import torch

        basis = Basis.draw(u, length_scales, features=_FREQUENCIES, seed=seed, degree=2)
        sobol = torch.quasirandom.SobolEngine(u.shape[1], scramble=True, seed=seed)
        waves = basis(sobol.draw(_POINTS, dtype=torch.float64).numpy())[:, -2 * _FREQUENCIES :]
        values, vectors = np.linalg.eigh(waves.T @ waves)
        left = np.cumsum(values[::-1]) >= (1 - _SHARE) * values.sum()
        kept = min(int(np.argmax(left)) + 1, most)
        return cls(basis, np.ascontiguousarray(vectors[:, ::-1][:, :kept]))

    @property
    def size(self) -> int:
        """Number of eigenfunctions r, which follow the polynomial."""
        return self.turn.shape[1]

    @property
    def rates(self) -> Array:
        """Root mean square frequency along each coordinate, shape (p,)."""
        return np.sqrt(np.mean(self.basis.frequencies**2, axis=0)) / self.basis.scale

    def __call__(self, u: Array) -> Array:
        """Returns the features at `u` (n, p), shape (n, d)."""
        features, waves = self.basis(u), len(self.turn)
        return np.concatenate([features[:, :-waves], features[:, -waves:] @ self.turn], axis=1)
