r"""Further pours join what a surrogate knows, without a fit.

A surrogate's coefficients have the posterior $N(c, B B^T)$ for each axis. Further pours with
features F, scales s and what is left $r = (y - F c) / s$ are seen with their noise and with the
part of $\lambda$ that near pours share (`surrogate.py`):

$$ G = s^{-1} F B, \quad K = G G^T + I + \lambda E, \quad
   E_{ii'} = e^{-|u_i - u_{i'}|^2 / 2 w^2}, $$

$$ c' = c + B G^T K^{-1} r, \qquad B' B'^T = B (I - G^T K^{-1} G) B^T. $$

It is the posterior of all pours with the widths of the coefficients' priors, the scales and the
axes that the archive has decided: some 100 pours would hardly move these, and a fit anew takes as
long as the first. Of $B'$ the few directions in which it is less than B are kept (`roots.py`).
Left-out residuals of the further pours, $K^{-1} r$ over its own diagonal of $K^{-1}$, join those of
the archive.

Reference:
    Rasmussen and Williams, Gaussian processes for machine learning, 2006, sections 2.1 (weights)
    and 5.4.2 (left-out residuals).
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.inverse import inverse_of
from granulcal.loop.surrogate.linearised import NEAR
from granulcal.loop.surrogate.roots import Change
from granulcal.loop.surrogate.surrogate import DONOR_SHARE, Surrogate

__all__ = ["conditioned"]

Array = NDArray[np.float64]

# Shares of a direction's variance below this are rounding.
_TOLD = 1e-12


def conditioned(surrogate: Surrogate, rows: Rows) -> Surrogate:
    """Returns the surrogate that knows further pours; those with a statistic missing are left out.

    Args:
        surrogate: of an archive; an anchor is gone, for it held the gap that these pours close.
        rows: in unit coordinates, all statistics of the archive.
    """
    rows = rows.taken(np.all(np.isfinite(rows.x[:, surrogate.columns]), axis=1))
    if len(rows) == 0:
        return surrogate
    u = np.column_stack([rows.theta, rows.condition])
    y = surrogate.standardise(rows.x)
    for k in np.nonzero(rows.psi.any(axis=0))[0]:
        y -= rows.psi[:, k, None] * surrogate.effect_move(rows.theta, rows.condition, int(k))
    features = surrogate.features(rows.theta, rows.condition, rows.psi)
    scale = surrogate.scale(rows.theta, rows.condition, rows.psi)
    apart = np.sum((u[:, None, :] - u[None]) ** 2, axis=2)
    shared = np.exp(-0.5 * apart / NEAR**2)
    coefficients = surrogate.coefficients.copy()
    changes = []
    white, noise = np.empty(y.shape), np.empty(y.shape)
    for j in range(surrogate.size):
        along = surrogate.roots.times(features / scale[:, j, None], j)
        left = (y[:, j] - features @ coefficients[j]) / scale[:, j]
        inverse = inverse_of(along @ along.T + np.eye(len(u)) + surrogate.lack[j] * shared)
        known = inverse @ left
        coefficients[j] += surrogate.roots.on(along.T @ known, j)
        changes.append(_told(along, inverse))
        own = np.diag(inverse)
        white[:, j], noise[:, j] = known / own, known / np.sqrt(own)
    low, high = surrogate.raw_range
    donors = np.random.default_rng(len(surrogate.rows)).random(len(u)) < DONOR_SHARE
    return replace(
        surrogate,
        coefficients=coefficients,
        roots=surrogate.roots.after(changes),
        white=np.concatenate([surrogate.white, white]),
        noise=np.concatenate([surrogate.noise, noise]),
        rows=np.concatenate([surrogate.rows, u]),
        is_donor=np.concatenate([surrogate.is_donor, donors]),
        shares=np.concatenate([surrogate.shares, np.ones(len(u))]),
        anchor=None,
        raw_range=np.stack([np.fmin(low, rows.x.min(axis=0)), np.fmax(high, rows.x.max(axis=0))]),
    )


def _told(along: Array, inverse: Array) -> Change:
    """What (I - G^T K^-1 G)^(1/2), G = `along`, takes from a root that it follows.

    With Q = G^T K^(-1/2) = U S V^T the square root is I - U (1 - (1 - S^2)^(1/2)) U^T.
    """
    half = np.linalg.cholesky(inverse)
    squares, turns = np.linalg.eigh(half.T @ (along @ along.T) @ half)
    told = squares > _TOLD
    squares = np.minimum(squares[told], 1.0)
    directions = (along.T @ (half @ turns[:, told])) / np.sqrt(squares)
    return Change(directions, 1 - np.sqrt(1 - squares))
