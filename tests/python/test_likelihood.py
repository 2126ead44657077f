"""Emulated likelihood, its several pours, the test of an observation, what can be known."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

from granulcal.bayessim import BayesSim
from granulcal.bayessim.check.diagnostics import binomial_band, tarp
from granulcal.bayessim.check.identifiability import Identifiability
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.emulator.noise import Noise
from granulcal.bayessim.emulator.ridge import Ridge
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training.pairs import TrainingPairs
from granulcal.errors import TrainingDataError
from granulcal.parameter import Parameter
from granulcal.prior import Prior


@pytest.fixture(scope="module")
def toy():
    return LinearGaussian.random(seed=1, noise=2.0)


@pytest.fixture(scope="module")
def model(toy):
    theta, x = toy.simulate(500, seed=20)
    return BayesSim.fit(theta, x, toy.prior, quiet=True, method="emulated")


def test_ridge_leaves_out_what_a_refit_leaves_out():
    generator = np.random.default_rng(0)
    features, y = generator.standard_normal((40, 6)), generator.standard_normal(40)
    fit = Ridge(features).fit(y)
    keep = np.arange(1, 40)
    gram = features[keep].T @ features[keep] + fit.ratio * np.eye(6)
    refit = np.linalg.solve(gram, features[keep].T @ y[keep])
    assert fit.loo_residuals(y)[0] == pytest.approx(y[0] - features[0] @ refit, rel=1e-9)


def test_noise_finds_correlation_and_tails():
    generator = np.random.default_rng(0)
    truth = Noise(np.linalg.cholesky(np.array([[1.0, 0.6], [0.6, 1.0]])), 5.0)
    found = Noise.fit(truth.sample(20_000, generator))
    assert found.degrees == 5.0
    np.testing.assert_allclose(found.root @ found.root.T, [[1, 0.58], [0.58, 1]], atol=0.04)


def test_noise_density_integrates_to_one():
    noise = Noise(np.linalg.cholesky(np.array([[1.0, -0.4], [-0.4, 2.0]])), 8.0)
    axis = np.linspace(-60, 60, 1201)
    grid = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    scales = np.broadcast_to([1.5, 0.7], grid.shape)
    for density in noise.log_densities(grid, scales, np.array([1.0, 2.0])):
        assert np.exp(density).sum() * 0.1**2 == pytest.approx(1, abs=5e-3)


def expected_likelihood(likelihood, z, u):
    """The equations of `likelihood.py`, with the emulator and the noise that training fits."""
    prediction, pours = likelihood.leading.predict(u), len(z)
    y = likelihood.axes.apply(z)[:, : likelihood.axis_count]
    noise, unknown = prediction.scales**2, prediction.unknown**2
    share = np.ones((len(u), 1))
    if pours > 1:
        ratios = np.minimum(y.var(axis=0, ddof=1) / noise, 2.0)
        doubt = 1 + 2 * np.sqrt(2 / (y.shape[1] * (pours - 1)))
        share = np.minimum(1.0, doubt * ratios.mean(axis=1, keepdims=True))
    variance = likelihood.widening**2 * (noise + unknown) - (1 - 1 / pours) * share * noise
    deviations = y.mean(axis=0) - prediction.means
    return likelihood.leading.noise.log_density(deviations, np.sqrt(variance))


@pytest.mark.parametrize("pours", [1, 5])
def test_the_extension_evaluates_what_training_has_fitted(toy, model, pours):
    theta = np.repeat(toy.prior.sample(1, seed=3), pours, axis=0)
    z = model.standardiser.apply(toy.simulate_at(theta, seed=4))
    u = toy.prior.to_unconstrained(toy.prior.sample(200, seed=5))
    expected = expected_likelihood(model.likelihood, z, u)
    np.testing.assert_allclose(model.likelihood.log_prob(z, u), expected, atol=1e-8)
    at_pool = expected_likelihood(model.likelihood, z, model.likelihood.pool[:500])
    np.testing.assert_allclose(model.likelihood.at_pool(z)[:500], at_pool, atol=1e-8)
    # The cells of training are the first points of the pool.
    np.testing.assert_array_equal(model.likelihood.cells[:500], model.likelihood.pool[:500])


@pytest.mark.parametrize("pours", [1, 5])
def test_several_pours_share_their_parameters(toy, model, pours):
    """Against the exact posterior: as wide within a tenth (measured: 7 % too narrow)."""
    divergences, spreads = [], []
    for seed in range(20):
        theta = np.repeat(toy.prior.sample(1, seed=700 + seed), pours, axis=0)
        x = toy.simulate_at(theta, seed=seed)
        exact, ours = toy.posterior(x), model.posterior(x)
        draws = exact.sample(300, seed=1)
        divergences.append(np.mean(exact.log_prob(draws) - ours.log_prob(draws)))
        spreads.append(ours.sample(1000).std(axis=0) / exact.sample(1000).std(axis=0))
    # The prior's own divergence is about 4 nat for one pour, 6 for five.
    assert np.mean(divergences) < (0.25 if pours == 1 else 0.5)
    assert 0.9 < np.mean(spreads) < 1.1


def test_conditions_are_joined_like_pours(toy, model):
    """The same condition twice, one pour each, has no less information than one pour."""
    theta = np.repeat(toy.prior.sample(1, seed=5), 2, axis=0)
    z = model.standardiser.apply(toy.simulate_at(theta, seed=2))
    conditions = [(model.likelihood, z[:1]), (model.likelihood, z[1:])]
    both = Posterior.from_conditions(toy.prior, conditions)
    one = Posterior.from_conditions(toy.prior, conditions[:1])
    narrow, wide = (each.density.sample(2000, 0).std(axis=0) for each in (both, one))
    assert np.all(narrow < 0.95 * wide)


@pytest.mark.parametrize("pours", [1, 4])
def test_false_alarms_are_as_many_as_said(toy, model, pours):
    count = 60
    alarms = 0
    for seed in range(count):
        theta = np.repeat(toy.prior.sample(1, seed=3000 + seed), pours, axis=0)
        alarms += not model.misfit(toy.simulate_at(theta, seed=seed)).is_inside
    assert alarms <= binomial_band(count, 0.05, probability=0.998)[1]


def test_a_shifted_statistic_is_noticed_and_named(toy, model):
    spread = np.sqrt(np.diag(toy.noise_covariance))
    found = []
    for seed in range(12):
        x = toy.simulate_at(toy.prior.sample(1, seed=seed), seed=seed)[0]
        x[seed] += 6 * spread[seed]
        misfit = model.misfit(x)
        found.append((not misfit.is_inside, misfit.statistics[0].name == f"statistic_{seed}"))
    assert np.mean([alarm for alarm, _ in found]) > 0.75
    alarmed = [named for alarm, named in found if alarm]
    assert np.mean(alarmed) > 0.7


def test_misfit_says_what_it_found(toy, model):
    x = toy.simulate(1, seed=3)[1][0]
    assert str(model.misfit(x)).startswith("inside the model")
    x[4] += 1e3
    assert "OUTSIDE THE MODEL" in str(model.misfit(x))
    assert "statistic_4" in str(model.misfit(x))


def test_what_cannot_be_known_is_said():
    """A statistic of one parameter only: the other two stay as they were."""
    prior = Prior(
        Parameter(path=f"theta.{name}", distribution="uniform", low=0.0, high=1.0) for name in "abc"
    )
    theta = prior.sample(400, seed=0)
    generator = np.random.default_rng(1)
    x = theta[:, [0, 0]] + 0.05 * generator.standard_normal((400, 2))
    model = BayesSim.fit(theta, x, prior, quiet=True, method="emulated")
    known = Identifiability.of(model.posterior(np.array([0.5, 0.5])))
    # A normal of this width against the unit interval: log(1 / (0.035 sqrt(2 pi e))).
    assert known.gains[0] == pytest.approx(1.9, abs=0.25)
    assert np.all(known.gains[1:] < 0.1)
    assert known.effective_dimension == pytest.approx(1, abs=0.15)
    assert abs(known.ridge[0]) < 0.1
    average = model.identifiability
    assert average is not None
    assert average.blind == ("b, wherever in the prior", "c, wherever in the prior")
    assert "no trace: b, wherever" in str(average)


def test_a_part_of_the_prior_without_a_trace_is_named():
    """The second parameter is seen where the first is high alone."""
    prior = Prior(
        Parameter(path=path, distribution="uniform", low=0.0, high=1.0)
        for path in ("material.friction", "ground.friction")
    )
    truth = prior.sample(300, seed=1)
    first, second = np.full(300, 1.0), np.where(truth[:, 0] > 2 / 3, 2.0, 0.0)
    known = [np.stack([first, second], axis=1)[i] for i in range(300)]
    posteriors: list[Any] = [
        SimpleNamespace(
            prior=prior,
            density=SimpleNamespace(
                identifiability=lambda gains=gains: (gains, np.eye(2), 1.0, [1.0, 0.0], 1.0)
            ),
        )
        for gains in known
    ]
    blind = Identifiability.average(posteriors, truth).blind
    assert [line.split(" (")[0] for line in blind] == [
        "ground.friction where material.friction is low",
        "ground.friction where material.friction is middle",
    ]


def test_the_prior_may_differ_from_the_proposal(toy):
    """Pairs drawn where the truth is rare give the posterior of the prior all the same."""
    narrow = Prior(
        Parameter(path=p.path, distribution="normal", mean=2.0, sd=1.5) for p in toy.prior.free
    )
    theta = narrow.sample(600, seed=1)
    x = toy.simulate_at(theta, seed=2)
    model = BayesSim.fit(theta, x, toy.prior, quiet=True, method="emulated", proposal=narrow)
    divergences = []
    for row in toy.simulate_at(narrow.sample(20, seed=9), seed=3):
        exact, ours = toy.posterior(row), model.posterior(row)
        draws = exact.sample(300, seed=1)
        divergences.append(np.mean(exact.log_prob(draws) - ours.log_prob(draws)))
    assert np.mean(divergences) < 0.25
    with pytest.raises(TrainingDataError, match="proposal must have the prior's parameters"):
        BayesSim.fit(theta, x, toy.prior, quiet=True, proposal=Prior.default())


@pytest.mark.parametrize(("factor", "passes"), [(1.0, True), (0.5, False), (2.0, False)])
def test_tarp_passes_the_exact_posterior_and_no_other(toy, factor, passes):
    theta, x = toy.simulate(300, seed=4)

    class Scaled:
        def __init__(self, row):
            self.exact = toy.posterior(row)

        def sample(self, n, seed=0):
            draws = self.exact.sample(n, seed)
            return draws.mean(axis=0) + factor * (draws - draws.mean(axis=0))

        def log_prob(self, theta):
            return self.exact.log_prob(theta)

    found = tarp([Scaled(row) for row in x], theta, toy.prior.sample(300, seed=8), draw_count=300)
    assert (found.p_value > 0.01) == passes


def test_a_failed_check_is_loud(toy, model):
    """Statistics of half the noise that the model knows: its regions are too wide."""
    quieter = LinearGaussian(toy.prior, toy.matrix, toy.noise_covariance / 16)
    theta, x = quieter.simulate(150, seed=1)
    check = model.check(theta, x, draw_count=200)
    assert not check.is_calibrated
    assert "TOO WIDE" in str(check) and "remedy" in str(check)
    assert "more often than they say" in str(check) and "too narrow" not in str(check)
    louder = LinearGaussian(toy.prior, toy.matrix, 9 * toy.noise_covariance)
    check = model.check(*louder.simulate(150, seed=1), draw_count=200)
    assert "OVERCONFIDENT" in str(check)
    assert "read the intervals as too narrow" in str(check) and "WIDE" not in str(check)


def test_the_noise_of_several_pours_is_as_large_as_it_is_at_their_fit():
    """Pours at the noisy end of a prior had been called wrong in a third of right models."""
    prior = Prior(
        [Parameter(path=f"t.{i}", distribution="uniform", low=0.0, high=1.0) for i in range(2)]
    )
    random = np.random.default_rng(0)
    slopes = np.random.default_rng(5).standard_normal((6, 2))

    def pours(u):
        noise = 0.1 * np.exp(2 * u[:, :1] - 1)
        clean = u @ slopes.T + 0.3 * np.sin(3 * u[:, :1])
        return clean + noise * random.standard_normal((len(u), 6))

    theta = prior.sample(300, seed=11)
    model = BayesSim.fit(theta, pours(theta), prior, seed=0, quiet=True, method="emulated")
    alarms = 0
    for _ in range(40):
        of_one = np.repeat([[0.9, random.random()]], 5, axis=0)
        alarms += not model.misfit(pours(of_one)).is_inside
    assert alarms <= 6, alarms


def test_statistics_that_are_the_same_raise_no_alarm():
    """As series after their end. Their difference is round-off, whose pours were compared, too."""
    prior = Prior([Parameter(path="a.b", distribution="uniform", low=0.0, high=1.0)])
    generator = np.random.default_rng(1)

    def pours(theta):
        one = theta + 0.1 * generator.standard_normal(theta.shape)
        return one * np.array([1.0, 2.0, -1.0])

    theta = prior.sample(400, seed=0)
    model = BayesSim.fit(theta, pours(theta), prior, quiet=True, method="emulated")
    truths = prior.sample(100, seed=5)
    alarms = sum(not model.misfit(pours(np.tile(one, (5, 1)))).is_inside for one in truths)
    assert alarms <= binomial_band(100, 0.05, probability=0.99)[1]


def test_pairs_that_are_there_twice_are_left_out():
    prior = Prior([Parameter(path="t", distribution="uniform", low=0.0, high=1.0)])
    theta = prior.sample(60, seed=3)
    x = np.column_stack([theta, theta**2]) + 0.1 * np.random.default_rng(1).random((60, 2))
    pairs = TrainingPairs.gather(np.tile(theta, (4, 1)), np.tile(x, (4, 1)), prior=prior)
    assert len(pairs.theta) == 60 and pairs.excluded["repeated"] == 180
    assert np.array_equal(pairs.x, x)
