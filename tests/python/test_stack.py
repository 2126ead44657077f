"""The arithmetic average of two posteriors; what several pours share."""

import numpy as np
import pytest

pytest.importorskip("torch")

from granulcal.bayessim.emulator.pooling import averaging_share
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.arithmetic import StackedDensity
from granulcal.bayessim.posterior.density import TruncatedMixture
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


def test_pours_share_what_they_do_not_differ_by():
    generator = np.random.default_rng(1)
    scales = np.ones((1, 16))
    noisy = [averaging_share(generator.standard_normal((5, 16)), scales)[0] for _ in range(200)]
    assert np.mean(noisy) > 0.98
    quiet = averaging_share(0.3 * generator.standard_normal((5, 16)), scales)[0]
    assert 0.05 < quiet < 0.2
    assert averaging_share(generator.standard_normal((1, 16)), scales)[0] == 1
