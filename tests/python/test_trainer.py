"""How a network is trained where there are many pairs."""

import numpy as np
import pytest

pytest.importorskip("torch")

from granulcal.bayessim.config import Config
from granulcal.bayessim.trainer import train


def test_many_pairs_take_fewer_passes_and_less_jitter():
    generator = np.random.default_rng(0)
    u = generator.standard_normal((20_000, 1))
    x = u + 0.01 * generator.standard_normal(u.shape)
    config = Config(features=4, ensemble=1, components=1, patience=400)
    result = train(u, x, np.ones(1), config=config, seed=0)
    assert result.status == "epoch_limit" and result.epoch_count == 40
    (mixture,) = result.network.mixtures(np.zeros((1, 1)))
    # Jitter of 0.05 would widen it to that.
    assert 0.008 < 1 / mixture.factors[0, 0, 0] < 0.015
