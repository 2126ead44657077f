r"""Best fit of parameters and strengths to the mean pours of all conditions.

$$ \hat w = \arg\min_{v, \psi_A} \; r^T V^{-1} r + v^T v, \qquad r = \bar z - m(v, \psi) $$

by Gauss-Newton steps in which V is held at the last point (iteratively reweighted least squares).
V takes no part in the gradient: a misspecified model would otherwise move to where its noise is
widest. In v the prior is standard normal; strengths are held within the ends of their priors.

Reference:
    Wedderburn, Quasi-likelihood functions, generalized linear models, and the Gauss-Newton method,
    Biometrika 61, 1974.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import LARGEST_Z, cube_from_normal
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate

__all__ = ["Fit", "Start", "fit_base", "improve"]

Array = NDArray[np.float64]

_STARTS, _KEPT = 384, 4
_STEPS = 8
# In prior standard deviations of theta and in strength: a small part of what pours can tell.
_TOLERANCE = 4e-3


@dataclass(frozen=True)
class Fit:
    """Parameters and strengths at a best fit.

    Attributes:
        v: prior z-scores of theta, shape (p,).
        psi: all strengths, shape (K,).
        active: effects whose strength was free.
        residual: stacked, shape (H m,).
        slopes: derivatives of the mean in v and psi[active], shape (H m, p + |A|).
        root: lower triangular L with L L^T = V, shape (H m, H m).
        square: r^T V^-1 r + v^T v.
        log_density: log of N(r; 0, V) N(v; 0, I).
    """

    v: Array
    psi: Array
    active: tuple[int, ...]
    residual: Array
    slopes: Array
    root: Array
    square: float
    log_density: float


@dataclass(frozen=True)
class Start:
    """Where a fit begins besides where the surrogate says.

    Attributes:
        v: prior z-scores of theta, shape (p,).
        psi: strengths of all effects, shape (K,).
    """

    v: Array
    psi: Array


def fit_base(
    surrogate: Surrogate, stack: StackedMeans, seed: int, starts: Sequence[Start] = ()
) -> tuple[LinearisedSurrogate, Fit]:
    """Returns the best fit without effects, and the surrogate around it."""
    places = [*_starts(surrogate, stack, seed), *(start.v for start in starts)]
    best: tuple[LinearisedSurrogate, Fit] | None = None
    at, counts, sessions = stack.conditions, stack.counts, stack.sessions
    local = LinearisedSurrogate.at(surrogate, at, counts, places[0], sessions)
    for start in places:
        fit = improve(local, stack.means.ravel(), start, local.none(), ())
        if best is None or fit.log_density > best[1].log_density:
            best = local, fit
    assert best is not None
    fit = best[1]
    # What is local is taken at the fit, and the fit once more with it.
    local = LinearisedSurrogate.at(surrogate, at, counts, fit.v, sessions)
    return local, improve(local, stack.means.ravel(), fit.v, local.none(), ())


def improve(
    local: LinearisedSurrogate,
    target: Array,
    v: Array,
    psi: Array,
    active: tuple[int, ...],
    *,
    root: Array | None = None,
    steps: int = _STEPS,
) -> Fit:
    """Returns the best fit near (v, psi).

    Args:
        local: the surrogate at the conditions.
        target: stacked means, shape (H m,).
        v: start, shape (p,).
        psi: start; strengths that are not active stay, shape (K,).
        active: effects whose strength is free.
        root: root of V, if V is to be held there throughout.
        steps: largest number of Gauss-Newton steps.
    """
    held = root is not None
    p = len(v)
    low = np.array([local.surrogate.design.effects[k].low for k in active])
    pull = np.concatenate([np.ones(p), np.full(len(active), 1e-6)])
    for _ in range(steps):
        if not held:
            root = np.asarray(np.linalg.cholesky(local.covariance(v, psi)), dtype=np.float64)
        assert root is not None
        mean, slopes = local.slopes(v, psi, active)
        solved = np.linalg.solve(root, np.column_stack([slopes, target - mean]))
        jac, left = solved[:, :-1], solved[:, -1]
        w = np.concatenate([v, psi[list(active)]])
        square = float(left @ left + pull @ w**2)
        free = np.ones(len(w), dtype=bool)
        # A strength at an end of its prior that wants to leave it is held there.
        gradient = jac.T @ left - pull * w
        for i in range(len(active)):
            value = w[p + i]
            outward = (value >= 1 and gradient[p + i] > 0) or (
                value <= low[i] and gradient[p + i] < 0
            )
            free[p + i] = not outward
        normal = jac[:, free].T @ jac[:, free] + np.diag(pull[free])
        step = np.zeros(len(w))
        step[free] = np.linalg.solve(normal, gradient[free])
        length = 1.0
        for _ in range(6):
            tried = w + length * step
            tried[:p] = np.clip(tried[:p], -LARGEST_Z, LARGEST_Z)
            tried[p:] = np.clip(tried[p:], low, 1.0)
            tried_psi = psi.copy()
            tried_psi[list(active)] = tried[p:]
            gone = np.linalg.solve(root, target - local.mean(tried[:p], tried_psi))
            if float(gone @ gone + pull @ tried**2) <= square + 1e-9:
                break
            length *= 0.4
        else:
            break
        moved = float(np.abs(tried - w).max())
        v, psi = tried[:p], tried_psi
        if moved < _TOLERANCE:
            break
    return summarise(local, target, v, psi, active, root if held else None)


def summarise(
    local: LinearisedSurrogate,
    target: Array,
    v: Array,
    psi: Array,
    active: tuple[int, ...],
    root: Array | None = None,
) -> Fit:
    """Returns the fit at (v, psi) as it is."""
    if root is None:
        root = np.asarray(np.linalg.cholesky(local.covariance(v, psi)), dtype=np.float64)
    mean, slopes = local.slopes(v, psi, active)
    white = np.linalg.solve(root, target - mean)
    square = float(white @ white + v @ v)
    log_det = 2 * float(np.log(np.diag(root)).sum())
    count = len(target) + len(v)
    log_density = -0.5 * (square + log_det + count * float(np.log(2 * np.pi)))
    return Fit(v, psi, active, target - mean, slopes, root, square, log_density)


def _starts(surrogate: Surrogate, stack: StackedMeans, seed: int) -> list[Array]:
    """Draws of the prior that fit best where only their noise counts."""
    p, effects = len(surrogate.design.parameters), len(surrogate.design.effects)
    v = np.random.default_rng(seed).standard_normal((_STARTS, p))
    v[0] = 0.0
    count = len(stack.conditions)
    theta = np.repeat(cube_from_normal(v), count, axis=0)
    rows = np.tile(stack.conditions, (_STARTS, 1))
    none = np.zeros((len(rows), effects))
    means = surrogate.mean(theta, rows, none).reshape(_STARTS, count, -1)
    scales = surrogate.scale(theta, rows, none).reshape(_STARTS, count, -1)
    # A coarse fit: the surrogate's error is taken as half the noise of a pour.
    spread = scales * np.sqrt(1 / stack.counts[:, None] + 0.25)
    whiten = np.linalg.inv(np.linalg.cholesky(surrogate.correlation)).T
    white = ((stack.means - means) / spread) @ whiten
    squares = np.sum(white**2, axis=(1, 2)) + np.sum(v**2, axis=1)
    return list(v[np.argsort(squares)[:_KEPT]])
