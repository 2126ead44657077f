r"""Ridge regression whose strength is chosen by its evidence, with leave-one-out residuals.

The model is $y = F c + \epsilon$ with $c \sim N(0, \sigma^2 I / r)$ and
$\epsilon \sim N(0, \sigma^2 I)$. With the eigenvalues $\lambda$ of $F^T F$ and
$b = Q^T F^T y$ everything about one ridge $r$ costs as many operations as there are columns:

$$ \hat c = Q (\lambda + r)^{-1} b, \qquad
   n \sigma^2 = y^T y - \sum_j b_j^2 / (\lambda_j + r), \qquad
   -2 \log p(y) = n \log \sigma^2 + \sum_j \log(1 + \lambda_j / r) + \text{const} $$

The residual of pair i under the fit to the others is $e_i / (1 - h_i)$ with the leverage
$h = \mathrm{diag}\, F (F^T F + r I)^{-1} F^T$.

Reference:
    MacKay, Bayesian interpolation, Neural Computation 4, 1992 (evidence).
    Golub, Heath and Wahba, Generalized cross-validation, Technometrics 21, 1979 (leave one out).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Ridge", "RidgeFit", "weighted_ridge"]

Array = NDArray[np.float64]

_RATIOS = np.geomspace(1e-5, 1e2, 29)
# With weights the best ridge is near that without: factors that are tried.
_NEAR = (0.1, 0.3, 1.0, 3.0)
# A leverage of 1 would divide by zero: such a pair alone decides its own prediction.
_LARGEST_LEVERAGE = 0.95


@dataclass(frozen=True)
class RidgeFit:
    """One regression.

    Attributes:
        coefficients: shape (d,).
        root: B with $B B^T = (F^T F + r I)^{-1}$, shape (d, d): times the noise variance this is
            the covariance of the coefficients.
        fitted: prediction at each pair, shape (n,).
        leverage: weight of each pair in its own prediction, shape (n,).
        log_evidence: log density of the data up to a constant that all fits of the data share.
        ratio: r.
    """

    coefficients: Array
    root: Array
    fitted: Array
    leverage: Array
    log_evidence: float
    ratio: float

    def loo_residuals(self, y: Array) -> Array:
        """Returns each pair's value less the prediction from the others, shape (n,)."""
        return (y - self.fitted) / (1 - self.leverage)


class Ridge:
    """Regressions of any number of targets on the same features.

    Args:
        features: F, shape (n, d).
        weights: precision of each pair's noise relative to the others, shape (n,), or None.
    """

    def __init__(self, features: Array, weights: Array | None = None) -> None:
        """Factorises once; each `fit` is then cheap."""
        self.features = features
        self.root_weights = np.ones(len(features)) if weights is None else np.sqrt(weights)
        self._scaled = features * self.root_weights[:, None]
        values, self._vectors = np.linalg.eigh(self._scaled.T @ self._scaled)
        self._values = np.maximum(values, 0.0)
        self._squared = (self._scaled @ self._vectors) ** 2

    def fit(self, y: Array) -> RidgeFit:
        """Returns the regression of `y` (n,) whose ridge has the highest evidence."""
        scaled = y * self.root_weights
        along = self._vectors.T @ (self._scaled.T @ scaled)
        total = float(scaled @ scaled)
        denominators = self._values[:, None] + _RATIOS
        left = total - np.sum(along[:, None] ** 2 / denominators, axis=0)
        # Data that the features reproduce exactly leave round-off of either sign.
        left = np.maximum(left, 1e-12 * max(total, 1e-300))
        log_det = np.sum(np.log1p(self._values[:, None] / _RATIOS), axis=0)
        evidence = -0.5 * (len(y) * np.log(left / len(y)) + log_det)
        best = int(evidence.argmax())
        ratio = float(_RATIOS[best])
        shrunk = 1 / (self._values + ratio)
        coefficients = self._vectors @ (shrunk * along)
        return RidgeFit(
            coefficients,
            self._vectors * np.sqrt(shrunk),
            self.features @ coefficients,
            np.minimum(self._squared @ shrunk, _LARGEST_LEVERAGE),
            float(evidence[best]),
            ratio,
        )


def weighted_ridge(features: Array, weights: Array, y: Array, ratio: float) -> RidgeFit:
    """Returns the regression of `y` (n,) on `features` (n, d) with `weights` (n,) on the pairs.

    One Cholesky factor for each ridge that is tried instead of an eigendecomposition.

    Args:
        features: F.
        weights: precision of each pair's noise relative to the others.
        y: targets.
        ratio: ridge of the regression without weights, near which the best is looked for.
    """
    root_weights = np.sqrt(weights)
    scaled, target = features * root_weights[:, None], y * root_weights
    gram, along, total = scaled.T @ scaled, scaled.T @ target, float(target @ target)
    identity = np.eye(len(gram))
    best: tuple[float, Array, Array, float] | None = None
    for factor in _NEAR:
        tried = ratio * factor
        lower = np.asarray(np.linalg.cholesky(gram + tried * identity), dtype=np.float64)
        half = np.asarray(np.linalg.solve(lower, along), dtype=np.float64)
        left = max(total - float(half @ half), 1e-12 * max(total, 1e-300))
        log_det = 2 * np.log(np.diag(lower)).sum() - len(gram) * np.log(tried)
        evidence = float(-0.5 * (len(y) * np.log(left / len(y)) + log_det))
        if best is None or evidence > best[0]:
            best = evidence, lower, half, tried
    assert best is not None
    root = np.asarray(np.linalg.inv(best[1]).T, dtype=np.float64)
    coefficients = root @ best[2]
    return RidgeFit(
        coefficients,
        root,
        features @ coefficients,
        np.minimum(np.sum((scaled @ root) ** 2, axis=1), _LARGEST_LEVERAGE),
        best[0],
        best[3],
    )
