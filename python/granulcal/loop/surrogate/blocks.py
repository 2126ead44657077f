r"""Bayesian ridge regression whose blocks of coefficients each have a prior width of their own.

$$ y = X c + \epsilon, \quad \epsilon_i \sim N(0, \sigma^2 s_i^2), \quad
   c_b \sim N(0, \tau_b^2 I) $$

with $\tau_b^2$ and $\sigma^2$ at a maximum of the evidence by the fixed point

$$ \gamma_b = d_b - \tau_b^{-2} \mathrm{tr} (A^{-1})_{bb}, \qquad
   \tau_b^2 = \lVert c_b \rVert^2 / \gamma_b, \qquad
   \sigma^2 = \lVert (y - X c) / s \rVert^2 / (n - \textstyle\sum_b \gamma_b) $$

A block that the data do not ask for shrinks to nothing: an effect without a trace has none here.

Reference:
    MacKay, Bayesian interpolation, Neural Computation 4, 1992, section 5 (equation 4.9).
    Tipping, Sparse Bayesian learning, JMLR 1, 2001 (one width for each block).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.bordered import Features, Gram
from granulcal.loop.surrogate.bordering import Bordering
from granulcal.loop.surrogate.roots import Root

__all__ = ["BlockFit", "fit_blocks", "fit_bordered"]

Array = NDArray[np.float64]

_ROUNDS = 12
# Prior widths relative to statistics of spread 1.
_SMALLEST, _LARGEST = 1e-8, 1e4
_LARGEST_LEVERAGE = 0.95


@dataclass(frozen=True)
class BlockFit:
    """One regression.

    Attributes:
        coefficients: shape (d,).
        root: B with B B^T = A^-1, the posterior covariance of the coefficients.
        left_out: residual of each row under a fit to the others, shape (n,).
        noise: the same, of the scale of the noise alone, shape (n,).
        dof: rows less the coefficients that they decided.
    """

    coefficients: Array
    root: Root
    left_out: Array
    noise: Array
    dof: float


def fit_blocks(x: Array, y: Array, scale: Array, blocks: list[slice], gram: Array) -> BlockFit:
    """Returns the regression of `y` (n,) on `x` (n, d).

    Args:
        x: features.
        y: target of spread about 1.
        scale: s, shape (n,).
        blocks: columns of each block; together all of them.
        gram: x^T s^-2 x, which several targets may share, shape (d, d).
    """
    bordering = Bordering.none(x.shape[1])
    features = Features(bordering, (), x / scale[:, None])
    found = fit_bordered(features, y / scale, blocks, Gram(bordering, (), gram[:0], gram))
    return replace(found, left_out=scale * found.left_out, noise=scale * found.noise)


def fit_bordered(x: Features, y: Array, blocks: list[slice], gram: Gram) -> BlockFit:
    """Returns the regression of `y` (n,) on features of which many never meet.

    Args:
        x: features; all s are 1.
        y: target of spread about 1.
        blocks: columns of each block; together all of them.
        gram: x^T x, which several targets may share.
    """
    along = x.along(y)
    size = np.concatenate([np.full(b.stop - b.start, i) for i, b in enumerate(blocks)])
    widths, known = np.ones(len(blocks)), np.zeros(len(blocks))
    variance = 0.3 * float(y @ y) / len(y)
    root, c, left = None, along, y
    for _ in range(_ROUNDS):
        root = gram.root(variance, 1 / widths[size])
        c = root.on(root.transposed_on(along / variance))
        left = y - x.times(c)
        spread = root.squares
        for i, block in enumerate(blocks):
            count = block.stop - block.start
            known[i] = max(count - float(spread[block].sum()) / widths[i], 1e-6)
            found = float(c[block] @ c[block]) / known[i]
            widths[i] = min(max(found, _SMALLEST), _LARGEST)
        variance = float(left @ left) / max(len(y) - known.sum(), 1.0)
    assert root is not None
    leverage = np.minimum(x.squares(root) / variance, _LARGEST_LEVERAGE)
    return BlockFit(
        c,
        root,
        left / (1 - leverage),
        left / np.sqrt(1 - leverage),
        float(len(y) - known.sum()),
    )
