r"""An empirical correction of the base model: no physics, tested conditions only.

To the base model at its fit $\hat\theta$ a discrepancy is added for each statistic,

$$ \delta_i(c) \sim GP\big(0, t_i^2 (\tfrac12 + \tfrac12 e^{-|c - c'|^2 / 2 l^2})\big), \qquad
   \hat\delta(c) = K_c (K + V)^{-1} r, $$

half of whose variance is the same under all conditions: what a model lacks it mostly lacks
everywhere. Its size is by moments, of the statistic itself and of all of them in equal parts,

$$ t_i^2 = \tfrac12 q_i + \tfrac1{2 m} \sum_j q_j, \qquad
   q_i = \max\Big(0, \tfrac1H \sum_h r_{hi}^2 - (M V)_{hi,hi} \Big) $$

A statistic whose residual happens to be small at the tested conditions is not known to be right.
The parameters stay where they are, so the correction may well repeat what they could have done: a
constraint to the contrary (Plumlee) is for whoever wants the parameters, and made predictions worse
(docs/theory/loop.md).

Reference:
    Kennedy and O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001.
    Plumlee, Bayesian calibration of inexact computer models, JASA 112, 2017 (orthogonality).
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import ObservationError
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.test.score import DISCREPANCY_LENGTH

__all__ = ["Discrepancy"]

Array = NDArray[np.float64]

# Nothing is predicted farther than this from the tested conditions, in length scales.
_REACH = 0.5
# Share of the variance that all conditions have in common, and that all statistics share.
_COMMON, _POOLED = 0.5, 0.5


@dataclass(frozen=True)
class Discrepancy:
    """A correction of the base model's standardised statistics.

    Attributes:
        conditions: tested, shape (H, q).
        variances: t^2, shape (m,).
        weights: (K + V)^-1 r, shape (H m,).
        precision: (K + V)^-1, shape (H m, H m).
    """

    conditions: Array
    variances: Array
    weights: Array
    precision: Array

    @classmethod
    def of(cls, local: LinearisedSurrogate, fit: Fit) -> "Discrepancy":
        """Returns the discrepancy that a base fit leaves."""
        count, size = len(local.conditions), local.surrogate.size
        root, slopes = local.in_statistics(fit.root), local.in_statistics(fit.slopes)
        residual = local.in_statistics(fit.residual)
        covariance = root @ root.T
        solved = np.asarray(np.linalg.solve(covariance, slopes), dtype=np.float64)
        normal = slopes.T @ solved + np.eye(len(fit.v))
        expected = covariance - slopes @ np.linalg.solve(normal, slopes.T)
        excess = residual**2 - np.diag(expected)
        own = np.maximum(excess.reshape(count, size).mean(axis=0), 0.0)
        variances = (1 - _POOLED) * own + _POOLED * own.mean()
        bare = cls(local.conditions, variances, np.empty(0), np.empty((0, 0)))
        kernel = bare._kernel(local.conditions, local.conditions)
        precision = np.asarray(np.linalg.inv(kernel + covariance), dtype=np.float64)
        return cls(local.conditions, variances, precision @ residual, precision)

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {field.name: getattr(self, field.name).tolist() for field in fields(self)}

    @classmethod
    def from_dict(cls, document: dict[str, Any]) -> "Discrepancy":
        """Returns what `to_dict` wrote."""
        rows = {name: np.array(value, dtype=np.float64) for name, value in document.items()}
        count = len(document["conditions"])
        rows["conditions"] = rows["conditions"].reshape(count, -1)
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
        """K between conditions, shape (A m, B m)."""
        gap = np.sum((a[:, None] - b[None]) ** 2, axis=2)
        shape = _COMMON + (1 - _COMMON) * np.exp(-0.5 * gap / DISCREPANCY_LENGTH**2)
        return np.kron(shape, np.diag(self.variances))
