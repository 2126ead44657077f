"""Draws of a density known up to a factor: many different ones, and of the right density."""

import numpy as np

from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.parameter import Parameter
from granulcal.prior import Prior

DIMENSION = 6


def test_draws_differ_and_have_mean_and_covariance() -> None:
    """A product over the prior of a normal with correlations and of the prior itself."""
    prior = Prior(
        [Parameter(path=f"p{i}", distribution="normal", mean=0.0, sd=1.0) for i in range(DIMENSION)]
    )
    generator = np.random.default_rng(0)
    root = 0.3 * generator.normal(size=(DIMENSION, DIMENSION)) / np.sqrt(DIMENSION)
    covariance = root @ root.T + 0.05 * np.eye(DIMENSION)
    mean = generator.normal(size=DIMENSION)
    narrow = Mixture.from_covariances(np.ones(1), mean[None], covariance[None])
    whole = Mixture(np.ones(1), np.zeros((1, DIMENSION)), np.eye(DIMENSION)[None])
    density = Posterior.from_mixtures(prior, [narrow, whole]).density
    draws = density.sample(4000, 1)
    # Of the weighted draws alone many would come back, each several times.
    assert len(np.unique(draws[:, 0])) > 3600
    spread = np.sqrt(np.diag(covariance))
    assert np.abs((draws.mean(axis=0) - mean) / spread).max() < 0.15
    assert np.abs(draws.std(axis=0) / spread - 1).max() < 0.1
    at = mean + 0.1 * generator.normal(size=(20, DIMENSION))
    exact = Posterior.from_mixture(prior, narrow).density.log_prob(at)
    np.testing.assert_allclose(density.log_prob(at), exact, atol=0.05)


def test_draws_stay_inside_the_bounds() -> None:
    """Two halves of an exponential slope, as normals of far away, on the unit interval."""
    prior = Prior([Parameter(path="a", distribution="uniform", low=0.0, high=1.0)])
    # Around 0 the logarithm of a normal at -50 with variance 10 falls by 5 per unit.
    half = Mixture.from_covariances(np.ones(1), np.array([[-50.0]]), np.array([[[10.0]]]))
    draws = Posterior.from_mixtures(prior, [half, half]).density.sample(3000, 0)
    assert draws.min() >= 0 and draws.max() <= 1
    assert abs(draws.mean() - 0.1) < 0.01
