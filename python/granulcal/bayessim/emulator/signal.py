r"""Linear change of the statistics that puts signal before noise.

Statistics of one pile share their noise and repeat each other. A cubic ridge regression on the
parameters splits each statistic into what the parameters explain and a leave-one-out residual;
the residual covariance R is whitened, and the whitened statistics are rotated to their principal
axes. An axis with variance v then carries the signal-to-noise ratio $\rho = v - 1$, and its share
of the distance between two inputs is scaled by $\sqrt{\rho}$: axes of pure noise no longer decide
which pairs the kernel calls near.

Reference:
    Fisher, The use of multiple measurements in taxonomic problems, 1936 (whitening the scatter
    within, then principal axes; here the classes are a continuum).
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

__all__ = ["SignalAxes", "leave_one_out_residuals"]

Array = NDArray[np.float64]

# Share of the residual covariance replaced by its diagonal, so that its inverse is stable.
_SHRINKAGE = 0.03
# Least residual variance of a standardised statistic: below it is round-off.
_LEAST_VARIANCE = 1e-4
# Least relevance kept, so that no axis is lost to an unlucky estimate.
_LEAST_RELEVANCE = 1e-3
_RIDGE = 1.0
_LARGEST_DEGREE = 3
_PAIRS_PER_TERM = 5


@dataclass(frozen=True)
class SignalAxes:
    """Inputs of the network: standardised statistics times `matrix`.

    Attributes:
        matrix: columns are axes scaled to unit spread, shape (s, a).
        relevance: factor on each axis' frequencies, root mean square 1, shape (a,).
    """

    matrix: Array
    relevance: Array

    @classmethod
    def identity(cls, count: int) -> "SignalAxes":
        """Returns the statistics as they are, all of equal relevance."""
        return cls(np.eye(count), np.ones(count))

    @classmethod
    def fit(cls, u: Array, x: Array) -> "SignalAxes":
        """Returns the axes of standardised pairs `u` (n, p), `x` (n, s)."""
        residuals = leave_one_out_residuals(u, x)
        noise = residuals.T @ residuals / len(residuals)
        diagonal = np.diag(np.maximum(np.diag(noise), _LEAST_VARIANCE))
        noise = (1 - _SHRINKAGE) * noise + _SHRINKAGE * diagonal + 1e-9 * np.eye(len(noise))
        whiten = np.linalg.inv(np.linalg.cholesky(noise)).T
        variances, axes = np.linalg.eigh(np.cov((x @ whiten).T).reshape(len(noise), -1))
        # Sign of an eigenvector is arbitrary; fix it so that the result is too.
        axes *= np.where(axes[np.abs(axes).argmax(axis=0), range(len(noise))] < 0, -1, 1)
        variances, axes = np.maximum(variances[::-1], 1e-12), axes[:, ::-1]
        relevance = np.maximum(np.sqrt(np.maximum(variances - 1, 0)), _LEAST_RELEVANCE)
        relevance /= np.sqrt(np.mean(relevance**2))
        return cls(whiten @ axes / np.sqrt(np.maximum(variances, 0.1)), relevance)

    def first(self, count: int) -> "SignalAxes":
        """Returns the `count` axes that tell most."""
        relevance = self.relevance[:count]
        return SignalAxes(
            np.ascontiguousarray(self.matrix[:, :count]),
            relevance / np.sqrt(np.mean(relevance**2)),
        )

    def apply(self, x: Array) -> Array:
        """Returns the network's inputs for standardised statistics `x` (n, s), shape (n, a)."""
        return x @ self.matrix


def leave_one_out_residuals(u: Array, x: Array) -> Array:
    """Returns each pair's statistics less a regression on the other pairs, shape (n, s).

    The regression is a ridge on polynomials of standardised `u` (n, p), cubic unless there are too
    few pairs for that many terms.
    """
    count, dimension = u.shape
    columns = [np.ones(count)]
    for degree in range(1, _LARGEST_DEGREE + 1):
        terms = list(combinations_with_replacement(range(dimension), degree))
        if degree > 1 and _PAIRS_PER_TERM * (len(columns) + len(terms)) > count:
            break
        columns += [np.prod(u[:, list(term)], axis=1) for term in terms]
    left, singular, _ = np.linalg.svd(np.stack(columns, axis=1), full_matrices=False)
    shrink = singular**2 / (singular**2 + _RIDGE)
    fitted = left @ (shrink[:, None] * (left.T @ x))
    leverage = np.minimum(left**2 @ shrink, 0.9)
    return (x - fitted) / (1 - leverage)[:, None]
