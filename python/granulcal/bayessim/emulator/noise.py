r"""Noise around an emulated mean: scales that change slowly, one correlation, Student tails.

$$ \epsilon \sim t_\nu(0, R), \qquad
   \log p = \log \Gamma(\tfrac{\nu + s}{2}) - \log \Gamma(\tfrac{\nu}{2})
   - \tfrac{s}{2} \log(\nu \pi)
   - \tfrac12 \log |R| - \tfrac{\nu + s}{2} \log(1 + \epsilon^T R^{-1} \epsilon / \nu) $$

Reference:
    Liu and Rubin, ML estimation of the t distribution using EM, Statistica Sinica 5, 1995.
    Smyth, Generalized linear models with varying dispersion, JRSS B 51, 1989 (log scales).
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["Noise", "fit_log_scale"]

Array = NDArray[np.float64]

# Share of the correlation that is replaced by none.
_SHRINKAGE = 0.03
_DEGREES = (3.0, 5.0, 8.0, 15.0, 40.0, 200.0)
# Where most residuals are small and some are large: hardly a variance, or none.
_HEAVY_DEGREES = (1.0, 1.5, 2.0)
_EM_ROUNDS = 8
# Ridges of the log scale, chosen by leave-one-out deviance.
_PENALTIES = (0.3, 3.0, 30.0, 300.0)
_NEWTON_ROUNDS = 12
_SMALLEST_STEP = 0.01
# A squared residual counts as this many times its expectation at most.
_LARGEST_RATIO = 25.0


@dataclass(frozen=True)
class Noise:
    r"""Multivariate t of s statistics.

    Attributes:
        root: lower triangular, root root^T = R, shape (s, s).
        degrees: $\nu$.
    """

    root: Array
    degrees: float

    @classmethod
    def fit(cls, white: Array, *, heavy: bool = False) -> "Noise":
        """Returns the noise of standardised residuals, shape (n, s).

        Args:
            white: the residuals.
            heavy: whether the degrees of freedom may be 2 and fewer.
        """
        count, size = white.shape
        best: tuple[float, Array, float] | None = None
        scatter = white.T @ white / count + 1e-9 * np.eye(size)
        for degrees in (_HEAVY_DEGREES * heavy + _DEGREES)[::-1]:
            for _ in range(_EM_ROUNDS):
                pull = (degrees + size) / (degrees + _squared_length(white, scatter))
                scatter = (white * pull[:, None]).T @ white / count + 1e-9 * np.eye(size)
            found = cls(np.linalg.cholesky(scatter).astype(np.float64), degrees)
            score = float(found.log_density(white, np.ones_like(white)).sum())
            if best is None or score > best[0]:
                best = score, scatter, degrees
        assert best is not None
        scatter = (1 - _SHRINKAGE) * best[1] + _SHRINKAGE * np.diag(np.diag(best[1]))
        return cls(np.linalg.cholesky(scatter).astype(np.float64), best[2])

    @cached_property
    def _whiten(self) -> Array:
        return np.linalg.inv(self.root).T.astype(np.float64)

    def log_density(self, deviations: Array, scales: Array) -> Array:
        """Returns the log density of `deviations` (n, s) with `scales` (n, s), shape (n,)."""
        return self.log_densities(deviations, scales, np.ones(1))[0]

    def log_densities(self, deviations: Array, scales: Array, inflations: Array) -> Array:
        """Returns the same with all scales times each of `inflations` (f,), shape (f, n)."""
        size, nu = len(self.root), self.degrees
        white = (deviations / scales) @ self._whiten
        squares = np.einsum("ij,ij->i", white, white) / inflations[:, None] ** 2
        constant = math.lgamma((nu + size) / 2) - math.lgamma(nu / 2)
        constant -= 0.5 * size * math.log(nu * math.pi) + np.log(np.diag(self.root)).sum()
        log_scales = np.log(scales).sum(axis=1) + size * np.log(inflations)[:, None]
        return constant - log_scales - 0.5 * (nu + size) * np.log1p(squares / nu)

    def square(self, deviations: Array, scales: Array) -> Array:
        """Returns the squared length of `deviations` (n, s) in units of the noise, shape (n,)."""
        white = (deviations / scales) @ self._whiten
        return np.einsum("ij,ij->i", white, white)

    def squares(self, y: Array, means: Array, scales: Array) -> Array:
        r"""Returns the squared lengths of `y` (n, s) less each of `means` (c, s), shape (n, c).

        As $y^T P y - 2 (P m)^T y + m^T P m$ with one precision P for each mean, so that all pairs
        are one product of matrices.
        """
        size = len(self.root)
        whiten = self._whiten[None] / scales[:, :, None]
        precisions = whiten @ whiten.transpose(0, 2, 1)
        pulls = np.einsum("cij,cj->ci", precisions, means)
        rows, columns = np.triu_indices(size)
        twice = np.where(rows == columns, 1.0, 2.0)
        table = np.column_stack(
            [precisions[:, rows, columns] * twice, -2 * pulls, np.sum(pulls * means, axis=1)]
        )
        known = np.column_stack([y[:, rows] * y[:, columns], y, np.ones(len(y))])
        return np.maximum(known @ table.T, 0.0)

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` draws of unit scale, shape (n, s)."""
        normal = generator.standard_normal((n, len(self.root))) @ self.root.T
        return normal * np.sqrt(self.degrees / generator.chisquare(self.degrees, n))[:, None]


def fit_log_scale(design: Array, residuals: Array, *, constant: bool = False) -> Array:
    r"""Returns coefficients of the log scale, by penalised likelihood of $N(0, e^{2 F c})$.

    Args:
        design: features, the first column a constant, shape (n, e).
        residuals: shape (n,).
        constant: whether the scale is one number.
    """
    squares = residuals**2
    mean = max(float(squares.mean()), 1e-12)
    start = np.zeros(design.shape[1])
    start[0] = 0.5 * math.log(mean) / design[0, 0]
    if constant:
        return start
    penalty = np.ones(design.shape[1])
    penalty[0] = 1e-6
    gram = 2 * design.T @ design
    best: tuple[float, Array] | None = None
    for strength in _PENALTIES:
        coefficients = start
        curvature = gram + strength * np.diag(penalty)
        inverse = np.linalg.inv(curvature)
        for _ in range(_NEWTON_ROUNDS):
            ratio = _ratio(squares, design @ coefficients)
            gradient = design.T @ (ratio - 1) - strength * penalty * coefficients
            step = inverse @ gradient
            size = np.abs(design @ step).max()
            coefficients = coefficients + step * min(1.0, 1.0 / max(size, 1e-12))
            if size < _SMALLEST_STEP:
                break
        leverage = np.minimum(2 * np.sum((design @ inverse) * design, axis=1), 0.9)
        log_scale = design @ coefficients
        pull = leverage / (1 - leverage) * 0.5 * (_ratio(squares, log_scale) - 1)
        left_out = log_scale - np.clip(pull, -1.0, 1.0)
        deviance = float(np.sum(left_out + 0.5 * _ratio(squares, left_out)))
        if best is None or deviance < best[0]:
            best = deviance, coefficients
    assert best is not None
    return best[1]


def _ratio(squares: Array, log_scale: Array) -> Array:
    return np.minimum(squares * np.exp(-2 * log_scale), _LARGEST_RATIO)


def _squared_length(white: Array, scatter: Array) -> Array:
    return np.sum(np.linalg.solve(np.linalg.cholesky(scatter), white.T) ** 2, axis=0)
