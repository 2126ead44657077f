r"""True pours at fits hold the surrogate there.

Where fresh pours of a model at its fit $(\hat v, \hat\psi)$ are not where the surrogate says, the
gap is known, within the noise of their mean:

$$ \delta_h = \bar x_h - m(\hat v, c_h, \hat\psi), \qquad
   \mathrm{cov}\,\delta_h = s R_h s / f_h $$

of f fresh pours of condition h. The anchored surrogate says $m + \delta$: right at the fit within
that noise, and near it as far as its slopes hold. Its own error stays in the covariance as it was,
for it is no better away from the fit. Under another condition, the same pours defined otherwise
among them, the gap is that of a Gaussian process through the known ones,

$$ \delta(c) = k(c)^T K^+ (\delta_1, \dots, \delta_H), \qquad
   k(c, c') = e^{-|c - c'|^2 / 2 w^2} $$

in unit coordinates; far from all of them it is 0. The pseudo-inverse gives repeats of one condition
their mean.

What the surrogate lacks at one fit says little of a model far away. So models that are compared are
held each by its own pours, in every round anew, and a place z of parameters and strengths has of
the gaps the weights of ordinary kriging, with the same k over places and K of the fits,

$$ \lambda(z) = C^{-1} k(z) + \frac{1 - 1^T C^{-1} k(z)}{1^T C^{-1} 1} C^{-1} 1, \qquad
   C = K + \eta, $$

near a fit nearly its own gap, far from all of them their mean.

References:
    Alexandrov, Dennis, Lewis and Torczon, A trust-region framework for managing the use of
    approximation models in optimization, Structural Optimization 15, 1998: a cheap model corrected
    to agree with the true one where the search stands, and again where that leads.
    Cressie, Statistics for Spatial Data, Wiley 1993, section 3.2 (ordinary kriging).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["Anchor", "Hold"]

Array = NDArray[np.float64]

# How far a gap is carried, in unit coordinates: as far as noise counts as near (`linearised.py`).
_WIDTH = 0.35
# Directions of K below this are of conditions that are one.
_SAME = 1e-9
# Variance of a gap's noise over that of gaps of other fits: eta.
_NUGGET = 0.05


@dataclass(frozen=True)
class Hold:
    """Gaps between true pours and the surrogate at one fit, under H conditions.

    Attributes:
        place: of the fit: parameters in unit coordinates and strengths, shape (p + K,).
        conditions: shape (H, q).
        gaps: delta, axes, shape (H, m).
        covariances: of each, shape (H, m, m).
    """

    place: Array
    conditions: Array
    gaps: Array
    covariances: Array

    def at(self, conditions: Array) -> Array:
        """Returns delta at rows of conditions, shape (n, m)."""
        return self._weights(conditions) @ self.gaps

    def covariance(self, conditions: Array) -> Array:
        """Returns the covariance of `at`, shape (n, m, n, m)."""
        weights = self._weights(conditions)
        return np.einsum("ah,bh,hij->aibj", weights, weights, self.covariances)

    def _weights(self, conditions: Array) -> Array:
        return _near(conditions, self.conditions) @ self._inverse

    @cached_property
    def _inverse(self) -> Array:
        """K^+: the mean of every step of a fit asks for it."""
        among = _near(self.conditions, self.conditions)
        return np.asarray(np.linalg.pinv(among, rcond=_SAME, hermitian=True), dtype=np.float64)


@dataclass(frozen=True)
class Anchor:
    """Holds at the fits of models that are compared.

    Attributes:
        holds: at least one.
    """

    holds: tuple[Hold, ...]

    def at(self, theta: Array, conditions: Array, psi: Array) -> Array:
        """Returns delta at rows of (theta, conditions, psi), shape (n, m)."""
        weights = self._weights(theta, psi)
        gaps = np.array([hold.at(conditions) for hold in self.holds])
        return np.einsum("na,anm->nm", weights, gaps)

    def covariance(self, theta: Array, conditions: Array, psi: Array) -> Array:
        """Returns the covariance of `at` for one theta (p,) and psi (K,), shape (n, m, n, m)."""
        weights = self._weights(theta[None], psi[None])[0]
        each = np.array([hold.covariance(conditions) for hold in self.holds])
        return np.asarray(np.tensordot(weights**2, each, axes=1), dtype=np.float64)

    def _weights(self, theta: Array, psi: Array) -> Array:
        """Weight of each hold at rows of (theta, psi), shape (n, A); they add up to 1."""
        plain = _near(np.column_stack([theta, psi]), self._places) @ self._inverse
        of_mean = self._inverse.sum(axis=0)
        missing = 1.0 - plain.sum(axis=1, keepdims=True)
        return np.asarray(plain + missing * of_mean / of_mean.sum(), dtype=np.float64)

    @cached_property
    def _places(self) -> Array:
        return np.array([hold.place for hold in self.holds])

    @cached_property
    def _inverse(self) -> Array:
        among = _near(self._places, self._places)
        return np.asarray(np.linalg.inv(among + _NUGGET * np.eye(len(among))), dtype=np.float64)


def _near(a: Array, b: Array) -> Array:
    apart = np.sum((a[:, None, :] - b[None]) ** 2, axis=2)
    return np.asarray(np.exp(-0.5 * apart / _WIDTH**2), dtype=np.float64)
