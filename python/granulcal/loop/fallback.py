r"""An empirical correction when no effect explains a residual: no physics, tested conditions only.

For each statistic a discrepancy $\delta_i(c) \sim GP(0, t_i^2 e^{-|c - c'|^2 / 2 l^2})$ is added to
the base model at $\hat\theta$. It may not repeat what the parameters can do: it is conditioned on
$B^T \delta = 0$ with $B = V^{-1} J$,

$$ k_\perp(x, x') = k(x, x') - k(x, \cdot) B (B^T K B)^{-1} B^T k(\cdot, x'), \qquad
   \hat\delta = K_\perp (K_\perp + V)^{-1} r, \qquad
   t_i^2 = \max\Big(0, \tfrac1H \sum_h r_{hi}^2 - (M V)_{hi,hi} \Big) $$

Reference:
    Kennedy and O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001.
    Plumlee, Bayesian calibration of inexact computer models, JASA 112, 2017 (orthogonality).
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import ObservationError
from granulcal.loop.baseline import Fit
from granulcal.loop.local import Local
from granulcal.loop.score import DISCREPANCY_LENGTH

__all__ = ["Discrepancy"]

Array = NDArray[np.float64]

# Nothing is predicted farther than this from the tested conditions, in length scales.
_REACH = 0.5


@dataclass(frozen=True)
class Discrepancy:
    """A correction of the base model's standardised statistics.

    Attributes:
        conditions: tested, shape (H, q).
        variances: t^2, shape (m,).
        constraint: B, shape (H m, p).
        weights: (K_perp + V)^-1 r, shape (H m,).
        precision: (K_perp + V)^-1, shape (H m, H m).
    """

    conditions: Array
    variances: Array
    constraint: Array
    weights: Array
    precision: Array

    @classmethod
    def of(cls, local: Local, fit: Fit) -> "Discrepancy":
        """Returns the discrepancy that a base fit leaves."""
        count, size = len(local.conditions), local.surrogate.size
        root, slopes = local.in_statistics(fit.root), local.in_statistics(fit.slopes)
        residual = local.in_statistics(fit.residual)
        covariance = root @ root.T
        constraint = np.asarray(np.linalg.solve(covariance, slopes), dtype=np.float64)
        normal = slopes.T @ constraint + np.eye(len(fit.v))
        expected = covariance - slopes @ np.linalg.solve(normal, slopes.T)
        excess = residual**2 - np.diag(expected)
        variances = np.maximum(excess.reshape(count, size).mean(axis=0), 0.0)
        bare = cls(local.conditions, variances, constraint, np.empty(0), np.empty((0, 0)))
        kernel = bare._kernel(local.conditions, local.conditions)
        precision = np.asarray(np.linalg.inv(kernel + covariance), dtype=np.float64)
        return cls(local.conditions, variances, constraint, precision @ residual, precision)

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {field.name: getattr(self, field.name).tolist() for field in fields(self)}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> "Discrepancy":
        """Returns what `to_dict` wrote."""
        rows = {name: np.array(value, dtype=np.float64) for name, value in document.items()}
        count = len(document["conditions"])
        rows["conditions"] = rows["conditions"].reshape(count, -1)
        rows["constraint"] = rows["constraint"].reshape(len(rows["weights"]), -1)
        return cls(**rows)

    def predict(self, condition: ArrayLike) -> tuple[Array, Array]:
        """Returns the correction of z at a condition (q,) and its standard deviation, each (m,).

        Raises:
            ObservationError: farther than half a length scale from the tested conditions.
        """
        at = np.atleast_1d(np.asarray(condition, dtype=np.float64))[None]
        low, high = self.conditions.min(axis=0), self.conditions.max(axis=0)
        outside = float(np.linalg.norm(np.maximum(low - at, 0) + np.maximum(at - high, 0)))
        if outside > _REACH * DISCREPANCY_LENGTH:
            raise ObservationError(
                f"the correction holds up to {_REACH * DISCREPANCY_LENGTH:g} (unit range) outside "
                f"the tested conditions, asked for {outside:.3g}"
            )
        across = self._kernel(at, self.conditions)
        variance = np.diag(self._kernel(at, at) - across @ self.precision @ across.T)
        return across @ self.weights, np.sqrt(np.maximum(variance, 0.0))

    def _kernel(self, a: Array, b: Array) -> Array:
        """k_perp between conditions, shape (A m, B m)."""
        plain, left = self._plain(a, b), self._plain(a, self.conditions) @ self.constraint
        right = self.constraint.T @ self._plain(self.conditions, b)
        own = self.constraint.T @ self._plain(self.conditions, self.conditions) @ self.constraint
        return plain - left @ np.linalg.pinv(own, hermitian=True) @ right

    def _plain(self, a: Array, b: Array) -> Array:
        gap = np.sum((a[:, None] - b[None]) ** 2, axis=2)
        return np.kron(np.exp(-0.5 * gap / DISCREPANCY_LENGTH**2), np.diag(self.variances))
