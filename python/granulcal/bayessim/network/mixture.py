"""Gaussian mixture with full covariances, kept as Cholesky factors of the precisions.

Its density is evaluated by the extension, as a posterior's: `Posterior.from_mixture`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mixture"]

Array = NDArray[np.float64]


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
    def covariances(self) -> Array:
        """Covariances of the components, shape (k, p, p)."""
        precisions = self.factors @ self.factors.transpose(0, 2, 1)
        return np.linalg.inv(precisions).astype(np.float64)

    @property
    def arrays(self) -> tuple[Array, Array, Array]:
        """Weights, means and factors as the extension takes them."""
        weights, means, factors = (
            np.ascontiguousarray(part, dtype=np.float64)
            for part in (self.weights, self.means, self.factors)
        )
        return weights, means, factors
