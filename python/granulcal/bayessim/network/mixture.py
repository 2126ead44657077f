"""Gaussian mixture with full covariances, kept as Cholesky factors of the precisions."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mixture"]

Array = NDArray[np.float64]

# Points whose densities are held at once: so many stay in the processor's cache.
_BLOCK = 2048


@dataclass(frozen=True)
class Mixture:
    r"""Density $\sum_k \pi_k N(u; m_k, (F_k F_k^T)^{-1})$.

    Attributes:
        weights: $\pi$, positive, sum 1, shape (k,).
        means: $m$, shape (k, p).
        factors: $F$, lower triangular with positive diagonal; $F F^T$ is the precision,
            shape (k, p, p).
    """

    weights: Array
    means: Array
    factors: Array

    @classmethod
    def from_covariances(
        cls, weights: Array, means: Array, covariances: NDArray[np.floating]
    ) -> "Mixture":
        """Returns the mixture with the given `covariances`, shape (k, p, p)."""
        factors = np.linalg.cholesky(np.linalg.inv(covariances))
        return cls(weights, means, factors.astype(np.float64))

    @classmethod
    def pooled(cls, mixtures: "list[Mixture]") -> "Mixture":
        """Returns the equal-weight average of several densities, itself a mixture."""
        return cls(
            np.concatenate([m.weights for m in mixtures]) / len(mixtures),
            np.concatenate([m.means for m in mixtures]),
            np.concatenate([m.factors for m in mixtures]),
        )

    @property
    def dimension(self) -> int:
        """Number of coordinates p."""
        return self.means.shape[1]

    @property
    def covariances(self) -> Array:
        """Covariances of the components, shape (k, p, p)."""
        precisions = self.factors @ self.factors.transpose(0, 2, 1)
        return np.linalg.inv(precisions).astype(np.float64)

    def component_log_prob(self, u: Array) -> Array:
        """Returns log(weight * density) of every component at `u` (n, p), shape (k, n)."""
        # Whitened deviations F^T (u - m): the squared length is the Mahalanobis distance. One
        # product of matrices for each coordinate of all components.
        squares = np.zeros((len(u), len(self.weights)))
        for factors, shift in zip(self.factors.transpose(2, 1, 0), self._shifts, strict=True):
            off = u @ factors
            off -= shift
            off *= off
            squares += off
        squares *= -0.5
        squares += self._log_peaks
        return squares.T

    def log_bound(self) -> float:
        """Returns what the log density is nowhere above: that of the sum of all peaks."""
        return float(np.logaddexp.reduce(self._log_peaks))

    @cached_property
    def _shifts(self) -> Array:
        return np.einsum("kij,ki->jk", self.factors, self.means)

    @cached_property
    def _log_peaks(self) -> Array:
        log_det = np.log(np.diagonal(self.factors, axis1=1, axis2=2)).sum(axis=1)
        with np.errstate(divide="ignore"):
            return np.log(self.weights) + log_det - 0.5 * self.dimension * np.log(2 * np.pi)

    def log_prob(self, u: Array, *, quick: bool = False) -> Array:
        """Returns the log density at `u` (n, p), shape (n,).

        Args:
            u: points.
            quick: a third of the time; seven digits, which a weight needs not more of.
        """
        result = np.empty(len(u))
        for start in range(0, len(u), _BLOCK):
            rows = slice(start, start + _BLOCK)
            if quick:
                parts = self._quadratics @ _monomials(u[rows])
            else:
                parts = self.component_log_prob(u[rows])
            largest = parts.max(axis=0)
            largest = np.where(np.isfinite(largest), largest, 0.0)
            parts -= largest
            if quick:
                parts = parts.astype(np.float32)
            with np.errstate(divide="ignore"):
                result[rows] = largest + np.log(np.exp(parts, out=parts).sum(axis=0))
        return result

    @cached_property
    def _quadratics(self) -> Array:
        """Coefficients of `_monomials` in the log densities of the components, shape (k, q)."""
        precisions = self.factors @ self.factors.transpose(0, 2, 1)
        pulls = np.einsum("kij,kj->ki", precisions, self.means)
        rows, columns = np.triu_indices(self.dimension)
        once = np.where(rows == columns, -0.5, -1.0) * precisions[:, rows, columns]
        constants = self._log_peaks - 0.5 * np.sum(pulls * self.means, axis=1)
        return np.column_stack([once, pulls, constants])

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` independent draws in random order, shape (n, p)."""
        chosen = generator.choice(len(self.weights), size=n, p=self.weights)
        normal = generator.standard_normal((n, self.dimension))
        return self.place(chosen, normal)

    def place(self, chosen: NDArray[np.intp], normal: Array) -> Array:
        """Returns standard normal points (n, p) carried into their chosen components (n,)."""
        spreads = np.linalg.inv(self.factors).transpose(0, 2, 1)
        return self.means[chosen] + np.einsum("nij,nj->ni", spreads[chosen], normal)

    def conditional(self, given: dict[int, float]) -> "Mixture":
        """Returns the mixture of the other coordinates when some are known.

        Args:
            given: known value by index of the coordinate; at least one must stay free.
        """
        known = sorted(given)
        free = [i for i in range(self.dimension) if i not in given]
        if not free or not set(known) <= set(range(self.dimension)):
            raise ValueError(
                f"given must name some but not all of the coordinates 0..{self.dimension - 1}, "
                f"got {known}"
            )
        value = np.array([given[i] for i in known])
        covariances = self.covariances
        known_block = covariances[:, known][:, :, known]
        gain = covariances[:, free][:, :, known] @ np.linalg.inv(known_block)
        means = self.means[:, free] + np.einsum("kij,kj->ki", gain, value - self.means[:, known])
        remaining = covariances[:, free][:, :, free] - gain @ covariances[:, known][:, :, free]
        marginal = Mixture.from_covariances(self.weights, self.means[:, known], known_block)
        logits = marginal.component_log_prob(value[None, :])[:, 0]
        weights = np.exp(logits - logits.max())
        return Mixture.from_covariances(weights / weights.sum(), means, remaining)


def _monomials(u: Array) -> Array:
    """Products of two coordinates of `u` (n, p), the coordinates and one, shape (q, n)."""
    rows, columns = np.triu_indices(u.shape[1])
    each = np.ascontiguousarray(u.T)
    return np.concatenate([each[rows] * each[columns], each, np.ones((1, len(u)))])
