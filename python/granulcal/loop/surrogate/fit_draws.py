r"""Draws around a fit, $w \sim N(\hat w, (J^T V^{-1} J + \Lambda)^{-1})$."""

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import LARGEST_Z, Design, cube_from_normal
from granulcal.loop.surrogate.baseline import Fit

__all__ = ["draw"]

Array = NDArray[np.float64]


def draw(fit: Fit, design: Design, count: int, *, seed: int = 0) -> tuple[Array, Array]:
    """Returns theta in unit coordinates (count, p) and the active strengths (count, |A|)."""
    p, low = len(fit.v), np.array([design.effects[k].low for k in fit.active])
    white = np.linalg.solve(fit.root, fit.slopes)
    precision = np.concatenate([np.ones(p), np.full(len(low), 1e-6)])
    root = np.linalg.cholesky(np.linalg.inv(white.T @ white + np.diag(precision)))
    at = np.concatenate([fit.v, fit.psi[list(fit.active)]])
    drawn = at + np.random.default_rng(seed).standard_normal((count, len(at))) @ root.T
    theta = cube_from_normal(np.clip(drawn[:, :p], -LARGEST_Z, LARGEST_Z))
    return theta, np.clip(drawn[:, p:], low, 1.0)
