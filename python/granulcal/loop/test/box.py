r"""The normal of one or two strengths, cut to the box of their priors.

$$ \log \int_\mathrm{box} N(\psi; \mu, \Sigma) \, d\psi, \qquad
   p(\psi_i) = N(\psi_i; \mu_i, \Sigma_{ii}) \, (\Phi(b_i) - \Phi(a_i)) $$

with a and b the other strength's ends over its standard deviation, $\psi_i$ known. Logarithms
throughout: a model whose strengths are forty standard deviations beyond their ends is as improbable
as that says, and draws of the normal cannot tell (of 4,000 none in the box is no more than 8 nat).
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["log_mass", "marginal"]

Array = NDArray[np.float64]

_NODES = 401
# The mass beyond this below the largest is nothing [nat]; often enough for a width of 1e-12.
_DEPTH, _ZOOMS = 40.0, 12


def log_mass(mean: Array, covariance: Array, low: Array) -> float:
    """Returns the log of a normal's mass (d,), (d, d) between `low` (d,) and 1, d 1 or 2."""
    at, density = marginal(mean, covariance, low, 0)
    most = density.max()
    weights = np.exp(density - most)
    return float(most + np.log(np.sum((weights[1:] + weights[:-1]) / 2 * np.diff(at))))


def marginal(mean: Array, covariance: Array, low: Array, i: int) -> Array:
    """Returns nodes of strength `i` and the log of its density, the other within its ends, (2, n).

    It is log-concave: nodes are where it is not nothing.
    """
    at = np.linspace(float(low[i]), 1.0, _NODES)
    density = _density(at, mean, covariance, low, i)
    for _ in range(_ZOOMS):
        some = np.nonzero(density > density.max() - _DEPTH)[0]
        first, last = max(some[0] - 1, 0), min(some[-1] + 1, _NODES - 1)
        if last - first > _NODES / 2:
            break
        at = np.linspace(at[first], at[last], _NODES)
        density = _density(at, mean, covariance, low, i)
    return np.stack([at, density])


def _density(at: Array, mean: Array, covariance: Array, low: Array, i: int) -> Array:
    variance = covariance[i, i]
    density = -0.5 * ((at - mean[i]) ** 2 / variance + np.log(2 * np.pi * variance))
    if len(mean) == 1:
        return density
    j = 1 - i
    middle = mean[j] + covariance[i, j] / variance * (at - mean[i])
    spread = np.sqrt(covariance[j, j] - covariance[i, j] ** 2 / variance)
    return density + _log_between((low[j] - middle) / spread, (1 - middle) / spread)


def _log_between(a: Array, b: Array) -> Array:
    """Log of the standard normal's mass between a and b, a < b."""
    from scipy.special import log_ndtr

    # Of the upper half as of the lower one, where the logarithm keeps its digits.
    is_above = a > 0
    a, b = np.where(is_above, -b, a), np.where(is_above, -a, b)
    above, below = log_ndtr(b), log_ndtr(a)
    return above + np.log1p(-np.exp(below - above))
