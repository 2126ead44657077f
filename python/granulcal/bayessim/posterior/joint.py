"""The posterior of prior times likelihood: one material poured under one or several conditions."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.importance import (
    DEFENSIVE_SHARE,
    FEWEST_EFFECTIVE,
    Effort,
    ImportanceDensity,
    kernel_estimate,
    mix,
    prior_normal,
)
from granulcal.prior import Prior

__all__ = ["density_over_prior", "joint_density"]

Array = NDArray[np.float64]

_EFFORT = Effort(pool=2000, draws=1000, rounds=6, effective=150.0, good_share=0.25)


def joint_density(prior: Prior, conditions: list[tuple[Likelihood, Array]]) -> ImportanceDensity:
    """Returns the posterior of one material poured under one or several conditions.

    Args:
        prior: the prior, the same for all conditions.
        conditions: for each the likelihood and its pours, standardised, shape (k, s).
    """

    def log_likelihood(u: Array, quick: bool) -> Array:
        return np.sum([part.log_prob(z, u, quick=quick) for part, z in conditions], axis=0)

    log_weights = np.sum([likelihood.start(z) for likelihood, z in conditions], axis=0)
    return density_over_prior(prior, log_likelihood, conditions[0][0].pool, log_weights)


def density_over_prior(
    prior: Prior,
    log_likelihood: Callable[[Array, bool], Array],
    pool: Array,
    log_weights: Array,
    *,
    mixtures: tuple[Mixture, ...] = (),
) -> ImportanceDensity:
    """Returns prior times likelihood, normalised; a proposal is adapted if few draws carry weight.

    Args:
        prior: the prior.
        log_likelihood: up to a constant, of points inside the bounds, shape (n, p); the second
            argument says whether the exactness of a weight will do.
        pool: draws of the prior, shape (m, p).
        log_weights: the log likelihood at them, shape (m,).
        mixtures: kept with the result; where there are some, adaptation starts from them too.
    """

    def log_target(u: Array) -> Array:
        return log_likelihood(u, False) + prior.coordinate_log_prob(u)

    def weigh(u: Array) -> Array:
        return log_likelihood(u, True) + prior.coordinate_log_prob(u)

    found = ImportanceDensity.of_prior_draws(
        prior, log_target, pool, log_weights, weigh=weigh, mixtures=mixtures
    )
    if found.effective_sample_size >= FEWEST_EFFECTIVE:
        return found
    # A few draws alone have no covariance.
    weights = found.pool_weights + 1e-6
    wide = prior_normal(prior)
    first = kernel_estimate(pool, weights / weights.sum(), np.random.default_rng(0))
    if mixtures:
        first = mix(first, Mixture.pooled(list(mixtures)), 0.5)
    start = mix(first, wide, DEFENSIVE_SHARE)
    return ImportanceDensity.of(
        prior, log_target, start, wide, effort=_EFFORT, weigh=weigh, mixtures=mixtures
    )
