"""Emulator and network as one: the geometric average, its weights, and what is saved of it."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("torch")

from signed import sign

from granulcal.bayessim import BayesSim
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.emulator.basis import Basis
from granulcal.bayessim.emulator.emulator import Emulator
from granulcal.bayessim.emulator.likelihood import EmulatorChoice, Fold, Likelihood
from granulcal.bayessim.emulator.noise import Noise
from granulcal.bayessim.emulator.signal import SignalAxes
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.average import EMULATOR_ALONE, NETWORK_ALONE, Average, HeldOut
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.errors import ModelFormatError

SMALL: dict[str, Any] = {
    "features": 20,
    "ensemble": 2,
    "components": 2,
    "emulator_features": 20,
    "max_epochs": 30,
}
TOY = LinearGaussian.random(seed=1, noise=2.0)


def _normal_likelihood(prior, mean, covariance):
    """An emulator whose statistics are the coordinates, and the pour at which they are `mean`."""
    count, spreads = len(mean), np.sqrt(np.diag(covariance))
    origin, ones, still = np.zeros(count), np.ones(count), np.zeros((1, count))
    basis, scale_basis = (Basis(origin, ones, still, degree) for degree in (1, 2))
    polynomial = 3.0  # `_POLYNOMIAL` of `basis.py`: the size of constant and slopes.
    coefficients = np.zeros((count, 1 + count + 2))
    coefficients[:, 1 : 1 + count] = np.eye(count) / polynomial
    scales = np.zeros((count, scale_basis(still).shape[1]))
    scales[:, 0] = np.log(spreads) / polynomial
    unknown = np.zeros_like(scales)
    unknown[:, 0] = -20.0 / polynomial
    root = np.linalg.cholesky(covariance / np.outer(spreads, spreads))
    # Of so many degrees of freedom it is a normal.
    emulator = Emulator(
        basis, coefficients, scale_basis, scales, unknown, Noise(root, 1e6), origin, ones
    )
    likelihood = Likelihood(prior, SignalAxes.identity(count), emulator, emulator, 1.0)
    return likelihood, np.asarray(mean)[None]


def _normal(mean, covariance):
    return Mixture.from_covariances(np.ones(1), np.array([mean]), np.array([covariance]))


@pytest.mark.parametrize("average", [Average(0.6, 0.4), Average(0.9, 0.7), Average(1.0, 0.0)])
@pytest.mark.parametrize("width", [1.0, 0.05])
def test_normals_pool_to_the_normal_of_weighted_precisions(average, width):
    prior = TOY.prior
    first = np.array([[0.3, 0.1, 0.0], [0.1, 0.4, -0.1], [0.0, -0.1, 0.2]]) * width
    second = np.array([[0.2, -0.1, 0.1], [-0.1, 0.5, 0.0], [0.1, 0.0, 0.3]]) * width
    means = np.array([0.2, -0.4, 0.1]), np.array([0.1, -0.2, 0.3])
    condition = _normal_likelihood(prior, means[0], first)
    networks = [_normal(means[1], second)]
    pooled = Posterior.from_average(prior, condition, networks, average).density
    precisions = [average.emulator * np.linalg.inv(first), average.network * np.linalg.inv(second)]
    covariance = np.linalg.inv(sum(precisions) + (1 - average.network) * np.eye(3))
    mean = covariance @ (precisions[0] @ means[0] + precisions[1] @ means[1])
    exact = Posterior.from_mixture(prior, _normal(mean, covariance)).density
    points = exact.sample(50, 0)
    np.testing.assert_allclose(pooled.log_prob(points), exact.log_prob(points), atol=0.05)
    draws = pooled.sample(4000, 1)
    spreads = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(draws.mean(axis=0) - mean) < 0.1 * spreads)
    np.testing.assert_allclose(draws.std(axis=0), spreads, rtol=0.1)


def _two_measurements(pairs, sds, *, shared=False):
    """Held-out pairs of a standard normal parameter measured by two ways, on a grid."""
    generator = np.random.default_rng(3)
    truth = generator.standard_normal(pairs)
    noise = generator.standard_normal((pairs, 2))
    x = truth[:, None] + noise[:, [0, 0] if shared else [0, 1]] * sds
    grid = np.linspace(-6, 6, 1201)
    normal = -0.5 * grid**2 - 0.5 * np.log(2 * np.pi)
    # Log ratios of each posterior to the prior: the likelihoods.
    at_points = -0.5 * ((x[:, None] - grid[:, None]) / sds) ** 2
    at_truth = -0.5 * ((x - truth[:, None]) / sds) ** 2
    # Mean over the grid of 1201 points, instead of an integral with steps of 0.01.
    log_weights = np.tile(normal + np.log(12.01), (pairs, 1))
    return HeldOut(at_truth, at_points, log_weights, -0.5 * truth**2 - 0.5 * np.log(2 * np.pi))


def test_equal_measurements_count_the_same():
    found = _two_measurements(4000, np.array([0.5, 0.5])).choose()
    assert found.emulator == pytest.approx(0.5, abs=0.05)
    assert found.network == pytest.approx(1 - found.emulator)


def test_the_average_of_independent_measurements_is_normalised():
    held_out = _two_measurements(4000, np.array([0.5, 0.7]))
    # The exact posterior of both: mean log density of a normal of the summed precision.
    precision = 1 + 1 / 0.5**2 + 1 / 0.7**2
    exact = 0.5 * np.log(precision / (2 * np.pi)) - 0.5
    assert held_out.scores(Average(1, 1)).mean() == pytest.approx(exact, abs=0.05)


def test_no_weights_say_more_than_those_that_are_found():
    held_out = _two_measurements(300, np.array([0.5, 0.7]))
    best = held_out.scores(held_out.choose()).mean()
    tried = [Average(a, 1 - a) for a in np.arange(0, 1.01, 0.02)]
    assert best > max(held_out.scores(average).mean() for average in tried) - 1e-4


def test_an_average_has_to_earn_its_place():
    # The second says what the first says, and says it worse.
    held_out = _two_measurements(300, np.array([0.5, 1.0]), shared=True)
    assert held_out.choose() == EMULATOR_ALONE
    swapped = HeldOut(
        held_out.at_truth[:, ::-1],
        held_out.at_points[:, :, ::-1],
        held_out.log_weights,
        held_out.log_prior,
    )
    assert swapped.choose() == NETWORK_ALONE


@pytest.fixture(scope="module")
def averaged():
    theta, x = TOY.simulate(200, seed=4)
    model = BayesSim.fit(theta, x, TOY.prior, quiet=True, method="emulated", **SMALL)
    network = BayesSim.fit(theta, x, TOY.prior, quiet=True, method="mdrff", **SMALL)
    model.amortised, model.average = network.amortised, Average(0.6, 0.5)
    return model


def _density(model, mixture, row, average):
    condition = (model.likelihood, row[None])
    return Posterior.from_average(TOY.prior, condition, [mixture], average).density


def test_held_out_scores_are_those_of_the_posteriors(averaged):
    theta, x = TOY.simulate(6, seed=9)
    u, z = TOY.prior.to_unconstrained(theta), averaged.standardiser.apply(x)
    mixtures = averaged.amortised.mixtures(z)
    fold = Fold(averaged.likelihood, np.arange(6))
    held_out = HeldOut.of(fold, mixtures, u, z)
    for average in (EMULATOR_ALONE, NETWORK_ALONE, Average(0.6, 0.5)):
        densities = [
            _density(averaged, m, row, average) for m, row in zip(mixtures, z, strict=True)
        ]
        expected = [d.log_prob(truth[None])[0] for d, truth in zip(densities, u, strict=True)]
        np.testing.assert_allclose(held_out.scores(average), expected, atol=0.15)


def test_networks_of_several_pours_pool_like_one_of_their_mean_precision():
    prior, average = TOY.prior, Average(0.6, 0.4)
    spreads, means = (0.3, 0.2, 0.5), ([0.2, 0.0, 0.1], [-0.1, 0.3, 0.0], [0.0, 0.1, -0.2])
    precisions = [np.eye(3) / spread**2 for spread in spreads]
    networks = [
        _normal(np.array(m), np.linalg.inv(p)) for m, p in zip(means, precisions, strict=True)
    ]
    centre = np.array([0.1, 0.1, 0.0])
    likelihood, pour = _normal_likelihood(prior, centre, 0.16 * np.eye(3))
    # Pours that do not differ have no noise of their own that would average away.
    condition = (likelihood, np.repeat(pour, 3, axis=0))
    pooled = Posterior.from_average(prior, condition, networks, average).density
    shared = sum(precisions) / 3
    pull = sum(p @ np.array(m) for p, m in zip(precisions, means, strict=True)) / 3
    covariance = np.linalg.inv(
        average.emulator * np.eye(3) / 0.16
        + average.network * shared
        + (1 - average.network) * np.eye(3)
    )
    mean = covariance @ (average.emulator * centre / 0.16 + average.network * pull)
    exact = Posterior.from_mixture(prior, _normal(mean, covariance)).density
    points = exact.sample(50, 0)
    np.testing.assert_allclose(pooled.log_prob(points), exact.log_prob(points), atol=0.05)


def test_one_pour_shown_thrice_has_one_networks_posterior(averaged):
    theta, x = TOY.simulate(1, seed=9)
    z = averaged.standardiser.apply(x)
    mixtures = averaged.amortised.mixtures(z)
    condition = (averaged.likelihood, z)
    one, thrice = (
        Posterior.from_average(TOY.prior, condition, times * mixtures, averaged.average).density
        for times in (1, 3)
    )
    at = TOY.prior.to_unconstrained(theta)
    # The draws that the normalisers come from differ.
    np.testing.assert_allclose(thrice.log_prob(at), one.log_prob(at), atol=0.01)


def test_several_pours_of_an_arithmetic_average_are_the_emulators_alone(averaged):
    theta, x = TOY.simulate(3, seed=9)
    condition = (averaged.likelihood, averaged.standardiser.apply(x))
    mixtures = averaged.amortised.mixtures(condition[1])
    average = Average(0.6, 0.4, "arithmetic")
    several = Posterior.from_average(TOY.prior, condition, mixtures, average)
    alone = Posterior.from_conditions(TOY.prior, [condition])
    np.testing.assert_array_equal(several.log_prob(theta), alone.log_prob(theta))


def test_an_arithmetic_average_is_sampled_by_its_weights():
    """Two normals apart: the share of draws near each is its weight, in any part of the draws."""
    prior = TOY.prior
    condition = _normal_likelihood(prior, np.full(3, -1.0), 0.05 * np.eye(3))
    network = _normal(np.full(3, 1.5), 0.05 * np.eye(3))
    average = Average(0.3, 0.7, "arithmetic")
    draws = Posterior.from_average(prior, condition, [network], average).density.sample(4000, 0)
    assert np.mean(draws[:, 0] < 0.25) == pytest.approx(0.3, abs=0.03)
    assert np.mean(draws[:2000, 0] < 0.25) == pytest.approx(0.3, abs=0.05)


def test_an_average_comes_back_from_its_file(averaged, tmp_path):
    theta, x = TOY.simulate(20, seed=9)
    averaged.save(tmp_path / "model")
    loaded = BayesSim.load(tmp_path / "model")
    assert loaded.average == averaged.average
    np.testing.assert_array_equal(
        loaded.posterior(x[0]).log_prob(theta), averaged.posterior(x[0]).log_prob(theta)
    )


def test_a_file_of_version_3_is_an_arithmetic_average(averaged, tmp_path):
    theta, x = TOY.simulate(20, seed=9)
    averaged.save(tmp_path / "model")
    _edit(tmp_path / "model", version=3, average=None, network_weight=None)
    loaded = BayesSim.load(tmp_path / "model")
    assert loaded.average == Average(0.6, 0.4, "arithmetic")
    z = averaged.standardiser.apply(x[:1])
    emulated = Posterior.from_conditions(TOY.prior, [(averaged.likelihood, z)])
    learnt = Posterior.from_mixture(TOY.prior, averaged.amortised.mixtures(z)[0])
    both = np.log(0.6 * np.exp(emulated.log_prob(theta)) + 0.4 * np.exp(learnt.log_prob(theta)))
    np.testing.assert_allclose(loaded.posterior(x[0]).log_prob(theta), both, rtol=1e-10)
    # Saved anew it stays one.
    loaded.save(tmp_path / "again")
    assert BayesSim.load(tmp_path / "again").average == loaded.average


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"average": None}, "average must be there"),
        ({"network_weight": None}, "network_weight must be there"),
        ({"average": "harmonic"}, "geometric, arithmetic, got 'harmonic'"),
        ({"emulator_weight": -0.1}, "emulator_weight must be .* got -0.1"),
        ({"average": "arithmetic", "network_weight": 1.5}, "network_weight must be .* got 1.5"),
        ({"emulator_weight": 0.0, "network_weight": 0.0}, "one weight must be positive"),
        ({"has_network": False}, "0 without a network"),
    ],
)
def test_damaged_averages_are_named(averaged, tmp_path, changes, message):
    averaged.save(tmp_path / "model")
    _edit(tmp_path / "model", **changes)
    with pytest.raises(ModelFormatError, match=message):
        BayesSim.load(tmp_path / "model")


def _edit(folder, **changes):
    """Changes entries of a model's document; None takes one away."""
    path = folder / "model.json"
    document = {**json.loads(path.read_text()), **changes}
    kept = {
        key: value for key, value in document.items() if key not in changes or value is not None
    }
    path.write_text(json.dumps(kept))
    sign(folder)


def test_where_the_emulator_is_impossible_the_scores_are_numbers():
    """One draw of a network at which the likelihood is 0 had made every score of it NaN."""
    prior = TOY.prior
    fine, pour = _normal_likelihood(prior, np.zeros(3), 0.1 * np.eye(3))

    class Cut(Likelihood):
        def log_prob(self, z, u):
            return np.where(u[:, 0] > 0.5, -np.inf, super().log_prob(z, u))

    likelihood = Cut(prior, fine.axes, fine.emulator, fine.leading, 1.0)
    wide = [_normal(np.zeros(3), np.eye(3))]
    truth = np.full((1, 3), 0.1)
    held_out = HeldOut.of(Fold(likelihood, np.array([0])), wide, truth, pour)
    for average in (EMULATOR_ALONE, Average(0.5, 0.5), NETWORK_ALONE):
        assert np.isfinite(held_out.scores(average)).all()
    # The network's posterior is the prior.
    assert abs(held_out.gain(NETWORK_ALONE)) < 0.1
    assert held_out.gain(EMULATOR_ALONE) > 1.0


def test_what_says_all_that_the_cells_can_is_undecided_under_any_prior():
    """A normal prior of three parameters takes 4.3 nat off every score."""
    for prior_score in (0.0, -4.3):
        most = EmulatorChoice(3, 1.0, False, 8.2 + prior_score, prior_score, prior_score)
        assert not most.is_decided
        assert replace(most, score=6.0 + prior_score).is_decided
