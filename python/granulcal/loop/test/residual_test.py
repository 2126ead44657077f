r"""Is anything left of a fit? A p-value for the whole library, calibrated by replicates.

Three statistics of the efficient residual r in whitened coordinates: $Q = r^T r$ (anything),
$T = \max_k T_k$ (along the library), $V$ (a smooth unknown discrepancy; `score.py`). Replicates are
made at the fit: means of as many pours as were measured, their noise drawn from whitened residuals
of archive rows near the fit that made no covariance (so tails and local correlations are those of
pours), one draw of the surrogate's error and of the declared nuisances for all pours. The fit of
each is linear, $r_b = M (\epsilon_b + J \hat w)$; a few are refitted in full, and their mean over
the linear mean of the same replicates scales each statistic (Bartlett). The smallest of the three
p-values is ranked among its replicates, so that the whole is one test; the adjusted p-value of an
effect is by step-down over the library.

Reference:
    Westfall and Young, Resampling-based multiple testing, 1993 (min-p, algorithm 2.8).
    Davison and Hinkley, Bootstrap methods and their application, 1997, section 4.4.
    Bartlett, Properties of sufficiency and statistical tests, Proc. R. Soc. A 160, 1937.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.surrogate.baseline import Fit, improve
from granulcal.loop.surrogate.linearised import NEAR, LinearisedSurrogate
from granulcal.loop.test.score import Scores

__all__ = ["ResidualTest", "draw_errors", "residual_test"]

Array = NDArray[np.float64]

# Added to the diagonal of a covariance that may be singular.
_JITTER = 1e-9


@dataclass(frozen=True)
class ResidualTest:
    """The test of one fit.

    Attributes:
        p: of the three together.
        p_library, p_any, p_smooth: of T, Q and V alone.
        library, any, smooth: T, Q and V.
        factors: mean of full over linear replicates of T, Q and V, shape (3,).
        effects: effects tested, indices.
        squares: T_k, shape (K,).
        strengths: one-step strengths, shape (K,).
        adjusted: p of each effect, adjusted for the library, shape (K,).
    """

    p: float
    p_library: float
    p_any: float
    p_smooth: float
    library: float
    any: float
    smooth: float
    factors: Array
    effects: tuple[int, ...]
    squares: Array
    strengths: Array
    adjusted: Array


def residual_test(
    local: LinearisedSurrogate, fit: Fit, scores: Scores, *, replicates: int, refits: int, seed: int
) -> ResidualTest:
    """Returns the test of what a fit leaves.

    Args:
        local: the surrogate at the conditions.
        fit: the fit.
        scores: of the fit.
        replicates: linear replicates.
        refits: how many of them are refitted in full.
        seed: seed of the replicates.
    """
    generator = np.random.default_rng(seed)
    errors = draw_errors(local, fit, replicates, generator)
    prior = np.concatenate([fit.v, np.zeros(len(fit.active))])
    pulled = scores.whiten @ errors.T + (scores.slopes @ prior)[:, None]
    squares, null = _statistics(scores, scores.remain(pulled))
    residual = (scores.whiten @ fit.residual)[:, None]
    observed_squares, observed = _statistics(scores, residual)
    factors = _factors(local, fit, scores, errors[:refits], null[:, :refits])
    null = null * factors[:, None]
    single = np.array([_p(null[i], observed[i, 0]) for i in range(3)])
    ranks = np.stack([_ranks(row) for row in null])
    p = _p(-ranks.min(axis=0), -float(single.min()))
    return ResidualTest(
        p=p,
        p_library=float(single[0]),
        p_any=float(single[1]),
        p_smooth=float(single[2]),
        library=float(observed[0, 0]),
        any=float(observed[1, 0]),
        smooth=float(observed[2, 0]),
        factors=factors,
        effects=scores.effects,
        squares=observed_squares[:, 0],
        strengths=scores.strengths(residual)[:, 0],
        adjusted=_step_down(squares * factors[0], observed_squares[:, 0]),
    )


def draw_errors(
    local: LinearisedSurrogate, fit: Fit, count: int, generator: np.random.Generator
) -> Array:
    """Returns stacked deviations of mean pours from the surrogate's mean, shape (count, H m)."""
    surrogate, size = local.surrogate, local.surrogate.size
    scales = local.scales(fit.v, fit.psi)
    theta = cube_from_normal(fit.v)
    parts = []
    for h, condition in enumerate(local.conditions):
        near = surrogate.weights_near(theta, condition, NEAR) * surrogate.is_donor
        near = near / near.sum()
        # A difference of two means has no whole number of pours: rescaled to its scatter.
        pours = max(int(local.counts[h]), 1)
        chosen = generator.choice(len(near), size=(count, pours), p=near)
        noise = surrogate.noise - near @ surrogate.noise
        scatter = np.sqrt(pours / local.counts[h])
        parts.append(scatter * scales[h] * noise[chosen].mean(axis=1))
    errors = np.concatenate(parts, axis=1)
    shared = local.error_covariance(fit.v, fit.psi) + local.nuisance
    shared[np.diag_indices_from(shared)] += _JITTER
    root = np.linalg.cholesky(shared)
    return errors + generator.standard_normal((count, len(local.conditions) * size)) @ root.T


def _statistics(scores: Scores, residuals: Array) -> tuple[Array, Array]:
    """T_k (K, b), and T, Q, V (3, b) of whitened efficient residuals (n, b)."""
    squares = scores.squares(residuals)
    largest = squares.max(axis=0) if len(squares) else np.zeros(residuals.shape[1])
    any_ = np.sum(residuals**2, axis=0)
    return squares, np.stack([largest, any_, scores.unknown(residuals)])


def _factors(
    local: LinearisedSurrogate, fit: Fit, scores: Scores, errors: Array, linear: Array
) -> Array:
    if len(errors) == 0:
        return np.ones(3)
    mean = local.mean(fit.v, fit.psi)
    full = []
    for error in errors:
        refit = improve(local, mean + error, fit.v, fit.psi, fit.active)
        there = Scores.of(local, refit, scores.effects)
        full.append(_statistics(there, (there.whiten @ refit.residual)[:, None])[1][:, 0])
    return np.mean(full, axis=0) / np.maximum(linear.mean(axis=1), 1e-12)


def _p(null: Array, observed: float) -> float:
    return float((1 + np.sum(null >= observed)) / (1 + len(null)))


def _ranks(null: Array) -> Array:
    """p-value of each replicate among the others and itself."""
    ordered = np.sort(null)
    return (1 + len(null) - np.searchsorted(ordered, null, side="left")) / (1 + len(null))


def _step_down(null: Array, observed: Array) -> Array:
    """Westfall-Young adjusted p-values of `observed` (K,) given `null` (K, b)."""
    order = np.argsort(-observed)
    adjusted, highest = np.empty(len(observed)), 0.0
    for i, k in enumerate(order):
        p = _p(null[order[i:]].max(axis=0), float(observed[k]))
        highest = max(highest, p)
        adjusted[k] = highest
    return adjusted
