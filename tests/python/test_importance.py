"""Draws of a density known up to a factor: many different ones, and of the right density."""

import numpy as np

from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.importance import Effort, ImportanceDensity, mix, prior_normal
from granulcal.parameter import Parameter
from granulcal.prior import Prior

DIMENSION = 6


def _normal_prior() -> Prior:
    return Prior(
        [Parameter(path=f"p{i}", distribution="normal", mean=0.0, sd=1.0) for i in range(DIMENSION)]
    )


def _narrow_density(effort: Effort) -> tuple[ImportanceDensity, np.ndarray, np.ndarray]:
    """A normal with correlations, from a start that is too wide and beside it."""
    generator = np.random.default_rng(0)
    root = 0.3 * generator.normal(size=(DIMENSION, DIMENSION)) / np.sqrt(DIMENSION)
    covariance = root @ root.T + 0.05 * np.eye(DIMENSION)
    mean = generator.normal(size=DIMENSION)
    normal = Mixture.from_covariances(np.ones(1), mean[None], covariance[None])
    prior = _normal_prior()
    wide = prior_normal(prior)
    density = ImportanceDensity.of(
        prior, normal.log_prob, mix(wide, wide, 0.5), wide, effort=effort
    )
    return density, mean, covariance


def test_draws_differ_and_have_mean_and_covariance() -> None:
    density, mean, covariance = _narrow_density(Effort(pool=2000, draws=1000))
    draws = density.sample(4000, np.random.default_rng(1))
    # Of the weighted draws alone some hundred would come back, each many times.
    assert len(np.unique(draws[:, 0])) > 3600
    spread = np.sqrt(np.diag(covariance))
    assert np.abs((draws.mean(axis=0) - mean) / spread).max() < 0.15
    assert np.abs(draws.std(axis=0) / spread - 1).max() < 0.1


def test_a_pool_worth_few_draws_is_mended_by_the_steps() -> None:
    density, mean, covariance = _narrow_density(Effort(pool=600, draws=600, rounds=8))
    assert density.effective_sample_size < 400
    draws = density.sample(4000, np.random.default_rng(1))
    spread = np.sqrt(np.diag(covariance))
    assert np.abs((draws.mean(axis=0) - mean) / spread).max() < 0.25
    assert np.abs(draws.std(axis=0) / spread - 1).max() < 0.15
    assert len(np.unique(draws[:, 0])) == len(draws)


def test_draws_stay_inside_the_bounds() -> None:
    prior = Prior([Parameter(path="a", distribution="uniform", low=0.0, high=1.0)])
    wide = prior_normal(prior)
    density = ImportanceDensity.of(
        prior, lambda u: -u[:, 0] / 0.1, wide, wide, effort=Effort(pool=2000, draws=1000)
    )
    draws = density.sample(3000, np.random.default_rng(0))
    assert draws.min() >= 0 and draws.max() <= 1
    assert abs(draws.mean() - 0.1) < 0.01
