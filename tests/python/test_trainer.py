"""How a network is trained where there are many pairs."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")

from granulcal.bayessim import BayesSim
from granulcal.bayessim.check.toys import PileStandIn
from granulcal.bayessim.network.trainer import train
from granulcal.bayessim.training.config import Config
from granulcal.bayessim.training.summary import TrainingSummary


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


def test_validation_chooses_the_number_of_components():
    generator = np.random.default_rng(0)
    u = np.where(generator.random((600, 1)) < 0.5, -1.0, 1.0)
    u += 0.05 * generator.standard_normal(u.shape)
    x = generator.standard_normal(u.shape)
    config = Config(features=4, ensemble=1, components=(1, 2), max_epochs=60)
    chosen = train(u, x, np.ones(1), config=config, seed=0)
    assert chosen.network.layout.components == 2
    for count in (1, 2):
        alone = train(u, x, np.ones(1), config=replace(config, components=count), seed=0)
        assert chosen.validation_losses <= alone.validation_losses


def test_a_chosen_number_of_components_is_in_the_model(tmp_path):
    toy = PileStandIn(seed=0)
    theta, x = toy.simulate(150, seed=1)
    model = BayesSim.fit(
        theta,
        x,
        toy.prior,
        quiet=True,
        method="mdrff",
        components=(1, 2),
        features=10,
        ensemble=1,
        max_epochs=5,
    )
    assert model.amortised is not None
    kept = model.amortised.network.layout.components
    assert model.config.components == kept and kept in (1, 2)
    model.save(tmp_path / "model")
    loaded = BayesSim.load(tmp_path / "model")
    np.testing.assert_array_equal(
        loaded.posterior(x[0]).log_prob(theta), model.posterior(x[0]).log_prob(theta)
    )


def test_the_picture_of_a_training_has_the_pass_that_was_kept_at_its_least_loss(tmp_path):
    """Passes count from 1, and the curves began at 0: the line stood one pass after the least."""
    pytest.importorskip("matplotlib")
    summary = TrainingSummary(
        method="mdrff",
        choice="",
        pair_count=90,
        train_count=80,
        test_count=10,
        excluded={},
        horizon_count=0,
        epoch_count=4,
        best_epochs=(2,),
        curve=((4.0, 5.0), (3.0, 4.0), (2.0, 4.5), (1.0, 6.0)),
    )
    figure = summary.plot(tmp_path / "training.png")
    assert figure is not None
    _, validation, kept = figure.axes[0].lines
    x, y = np.array(validation.get_xdata()), np.array(validation.get_ydata())
    assert x.tolist() == [1, 2, 3, 4]
    assert np.array(kept.get_xdata()).tolist() == [x[y.argmin()]] * 2
