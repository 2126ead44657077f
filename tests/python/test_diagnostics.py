"""Diagnostics: they pass an exact posterior and catch a wrong one."""

import numpy as np
import pytest
from scipy import stats

from granulcal.bayessim.check.diagnostics import (
    binomial_band,
    expected_coverage,
    plot_coverage,
    plot_sbc,
    sbc_ranks,
)
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.posterior import Posterior

TRUTH_COUNT = 300


def posteriors(toy: LinearGaussian, x: np.ndarray, *, variance_factor: float, shift: float = 0.0):
    for row in x:
        exact = toy.normal(row)
        spread = np.sqrt(np.diagonal(exact.covariances, axis1=1, axis2=2))
        wrong = Mixture.from_covariances(
            exact.weights, exact.means + shift * spread, variance_factor * exact.covariances
        )
        yield Posterior.from_mixture(toy.prior, wrong)


@pytest.fixture(scope="module")
def toy_data():
    toy = LinearGaussian.random(seed=2, noise=2.0)
    theta, x = toy.simulate(TRUTH_COUNT, seed=11)
    return toy, theta, x


def test_band_matches_scipy():
    for total, share in [(50, 0.9), (400, 0.5), (1, 0.5)]:
        low, high = binomial_band(total, share)
        assert (low, high) == tuple(stats.binom(total, share).interval(0.95))


def test_exact_posterior_passes(toy_data):
    toy, theta, x = toy_data
    coverage = expected_coverage(posteriors(toy, x, variance_factor=1.0), theta, draw_count=300)
    assert coverage.is_calibrated
    assert stats.kstest(coverage.truth_levels, "uniform").pvalue > 0.01
    ranks = sbc_ranks(posteriors(toy, x, variance_factor=1.0), theta)
    assert ranks.is_calibrated()
    assert ranks.ranks.shape == (TRUTH_COUNT, 3)


def test_overconfident_posterior_is_caught(toy_data):
    toy, theta, x = toy_data
    coverage = expected_coverage(posteriors(toy, x, variance_factor=0.4), theta, draw_count=300)
    assert not coverage.is_calibrated
    assert all(count.inside < count.low for count in coverage.counts)
    assert not sbc_ranks(posteriors(toy, x, variance_factor=0.4), theta).is_calibrated()


def test_timid_posterior_is_caught(toy_data):
    toy, theta, x = toy_data
    coverage = expected_coverage(posteriors(toy, x, variance_factor=2.5), theta, draw_count=300)
    assert all(count.inside > count.high for count in coverage.counts)


def test_shifted_posterior_is_caught_by_ranks(toy_data):
    toy, theta, x = toy_data
    assert not sbc_ranks(posteriors(toy, x, variance_factor=1.0, shift=0.6), theta).is_calibrated()


def test_numbers_must_match(toy_data):
    toy, theta, x = toy_data
    for count in (0, 3, 7):
        few = posteriors(toy, x[:count], variance_factor=1.0)
        with pytest.raises(ValueError, match="one for each of 5 truths"):
            sbc_ranks(few, theta[:5], draw_count=5)
    with pytest.raises(ValueError, match="levels must lie"):
        expected_coverage([], theta, levels=[90])


def test_figures_are_written(toy_data, tmp_path):
    toy, theta, x = toy_data
    few = slice(0, 40)
    coverage = expected_coverage(
        posteriors(toy, x[few], variance_factor=1.0), theta[few], draw_count=50
    )
    ranks = sbc_ranks(posteriors(toy, x[few], variance_factor=1.0), theta[few], draw_count=50)
    plot_coverage(coverage, tmp_path / "coverage.png")
    plot_sbc(ranks, tmp_path / "sbc.png", names=toy.prior.names)
    assert all((tmp_path / f"{name}.png").stat().st_size > 5000 for name in ("coverage", "sbc"))
