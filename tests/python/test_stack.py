"""Emulator and network averaged: weights, density, draws; what several pours share."""

import numpy as np
import pytest

pytest.importorskip("torch")

from granulcal.bayessim.density import TruncatedMixture
from granulcal.bayessim.likelihood import averaging_share
from granulcal.bayessim.mixture import Mixture
from granulcal.bayessim.stack import StackedDensity, stacking_weight
from granulcal.prior import Prior


def _normal(centre, sd):
    covariance = np.eye(3)[None] * sd**2
    mixture = Mixture.from_covariances(np.ones(1), np.full((1, 3), centre), covariance)
    return TruncatedMixture.cut(Prior.default(), mixture)


def test_the_average_is_normalised_and_sampled_by_its_weights():
    density = StackedDensity(_normal(0.2, 0.05), _normal(0.8, 0.05), 0.3)
    axis = (np.arange(60) + 0.5) / 60
    cells = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    assert np.exp(density.log_prob(cells)).mean() == pytest.approx(1, abs=0.01)
    draws = density.sample(4000, np.random.default_rng(0))
    assert np.mean(draws[:, 0] < 0.5) == pytest.approx(0.3, abs=0.03)
    assert np.mean(draws[:2000, 0] < 0.5) == pytest.approx(0.3, abs=0.05)


def test_weights_are_those_that_say_most():
    generator = np.random.default_rng(0)
    good, bad = generator.standard_normal(200), generator.standard_normal(200) - 5
    assert stacking_weight(good, bad) == 1 and stacking_weight(bad, good) == 0
    # Each is far off on half of the pairs, the first on fewer.
    first = np.where(np.arange(200) < 60, -4.0, 1.0)
    second = np.where(np.arange(200) < 60, 1.0, -4.0)
    assert stacking_weight(first, second) == pytest.approx(0.7, abs=0.05)


def test_an_average_has_to_earn_its_place():
    # Both know as much, with errors of their own: many pairs say that the average gains.
    generator = np.random.default_rng(2)
    first, second = generator.normal(2.0, 0.5, (2, 400))
    assert stacking_weight(first[:9], second[:9]) in (0, 1)
    assert 0 < stacking_weight(first, second) < 1


def test_pours_share_what_they_do_not_differ_by():
    generator = np.random.default_rng(1)
    scales = np.ones((1, 16))
    noisy = [averaging_share(generator.standard_normal((5, 16)), scales)[0] for _ in range(200)]
    assert np.mean(noisy) > 0.98
    quiet = averaging_share(0.3 * generator.standard_normal((5, 16)), scales)[0]
    assert 0.05 < quiet < 0.2
    assert averaging_share(generator.standard_normal((1, 16)), scales)[0] == 1
