r"""Posterior of several pours of one material from their single posteriors.

Given theta the pours are independent, so

$$ p(u | x_1, ..., x_k) \propto p(u)^{1 - k} \prod_i p(u | x_i) $$

with the trained posterior in place of each $p(u | x_i)$. The product of k mixtures has too many
components to write down, so it is evaluated point by point (`importance.py`).
"""

import math

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.density import TruncatedMixture
from granulcal.bayessim.posterior.importance import (
    DEFENSIVE_SHARE,
    ImportanceDensity,
    mix,
    prior_normal,
)
from granulcal.prior import Prior

__all__ = ["product_density"]

Array = NDArray[np.float64]

# Odds of 20 to 1 against one shared material are reported as a warning by the posterior.
LEAST_LOG_EVIDENCE_RATIO = -math.log(20.0)


def product_density(
    prior: Prior, factors: list[TruncatedMixture], *, seed: int = 0
) -> ImportanceDensity:
    """Returns the product of truncated posteriors over prior^(k - 1), normalised.

    Its `log_normaliser` is also the log evidence of one shared theta against an independent theta
    for each pour.

    Args:
        prior: the prior.
        factors: posterior of each pour alone, at least two.
        seed: seed of the draws.
    """
    singles = Mixture.pooled([factor.mixture for factor in factors])
    wide = mix(singles, prior_normal(prior), DEFENSIVE_SHARE)
    return ImportanceDensity.of(
        prior,
        lambda u: _log_product(prior, factors, u),
        mix(_moment_product(prior, factors), wide, 0.5),
        wide,
        seed=seed,
        mixtures=tuple(factor.mixture for factor in factors),
    )


def _log_product(prior: Prior, factors: list[TruncatedMixture], u: Array) -> Array:
    total = sum(factor.log_prob(u) for factor in factors)
    return total - (len(factors) - 1) * prior.coordinate_log_prob(u)


def _moment_product(prior: Prior, factors: list[TruncatedMixture]) -> Mixture:
    """Product of one normal for each factor, over the prior's normals, made a little wider."""
    dimension = factors[0].mixture.dimension
    precision = np.zeros((dimension, dimension))
    information = np.zeros(dimension)
    for factor in factors:
        weights, means = factor.mixture.weights, factor.mixture.means
        centre = weights @ means
        inner = np.einsum("k,kij->ij", weights, factor.mixture.covariances)
        covariance = inner + (means - centre).T @ (weights[:, None] * (means - centre))
        precision += np.linalg.inv(covariance)
        information += np.linalg.solve(covariance, centre)
    normal = np.array([p.distribution == "normal" for p in prior.free], dtype=float)
    narrowed = precision - (len(factors) - 1) * np.diag(normal)
    # The prior's share can only be taken away while a proper density is left.
    if np.linalg.eigvalsh(narrowed).min() > 0.1 * np.linalg.eigvalsh(precision).min():
        precision = narrowed
    covariance = np.linalg.inv(precision)
    return Mixture.from_covariances(
        np.ones(1), (covariance @ information)[None], 1.5 * covariance[None]
    )
