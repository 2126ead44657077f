"""What a model is asked about: names, order, range of what was observed."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from toy_models import QUICK  # noqa: E402

from granulcal.bayessim import BayesSim  # noqa: E402
from granulcal.bayessim.posterior.posterior import OutOfRange  # noqa: E402
from granulcal.bayessim.training.pairs import TrainingPairs  # noqa: E402
from granulcal.errors import (  # noqa: E402
    ObservationError,
    TrainingDataError,
)
from granulcal.pours.statistics import NAMES, ObservedStatistics, Statistics  # noqa: E402


def test_observation_outside_the_training_range_is_a_warning(quick, toy):
    x = toy.simulate(2, seed=3)[1]
    x[1, 5] = 1e4
    assert quick.posterior(x[0]).warnings == ()
    found = [w for w in quick.posterior(x).warnings if isinstance(w, OutOfRange)]
    assert (found[0].pour, found[0].names, found[0].values) == (1, ("s5",), (1e4,))
    assert "s5 = 1e+04 (trained on" in str(found[0])
    assert repr(quick.posterior(x)).endswith("1 note in `warnings`: OutOfRange)")
    assert repr(quick.posterior(x[0])).endswith("mode and 90 % interval)")


@pytest.mark.parametrize(
    ("x_obs", "error", "message"),
    [
        (np.zeros(15), ObservationError, r"shape \(16,\) or \(k, 16\), got \(15,\)"),
        (np.zeros((0, 16)), ObservationError, r"got \(0, 16\)"),
        (np.zeros((1, 2, 16)), ObservationError, r"got \(1, 2, 16\)"),
        (np.r_[np.nan, np.zeros(15)], ObservationError, "not in s0"),
        (["a"] * 16, TypeError, "real numbers"),
        (3.0, ObservationError, r"got \(\)"),
    ],
)
def test_bad_observations(quick, x_obs, error, message):
    with pytest.raises(error, match=message):
        quick.posterior(x_obs)


class Series:
    """As one of pandas: numbers with an index."""

    def __init__(self, values, index) -> None:
        self.values, self.index = np.asarray(values), list(index)

    def keys(self):
        return self.index

    def to_numpy(self):
        return self.values

    __array__ = to_numpy


class Frame:
    """As one of pandas: a matrix whose columns have names; an index is of the rows."""

    def __init__(self, values, columns) -> None:
        self.values, self.columns = np.asarray(values), list(columns)
        self.index = range(len(self.values))

    def keys(self):
        return self.columns

    def to_numpy(self):
        return self.values

    __array__ = to_numpy


def observed_by_name(x, names) -> dict[str, object]:
    """The same pour in every form that carries names, in another order than the model's."""
    other = list(names)[::-1]
    values = np.array([x[list(names).index(name)] for name in other])
    return {
        "dict": dict(zip(other, values.tolist(), strict=True)),
        "dict of columns": dict(zip(other, values[:, None], strict=True)),
        "series": Series(values, other),
        "frame": Frame(values[None], other),
        "statistics": ObservedStatistics(values, tuple(other)),
        "list": [ObservedStatistics(values, tuple(other))],
        "plain": x,
        "index of numbers": Series(x, range(len(x))),
        "columns of numbers": Frame(x[None], range(len(x))),
    }


def test_observations_are_matched_by_their_names(quick, toy):
    x = toy.simulate(1, seed=3)[1][0]
    expected, misfit = quick.posterior(x).sample(5), quick.misfit(x)
    for form, observed in observed_by_name(x, quick.x_names).items():
        np.testing.assert_array_equal(quick.posterior(observed).sample(5), expected, form)
        assert quick.misfit(observed).p_value == misfit.p_value, form


def test_observations_of_other_names_are_refused(quick, toy):
    x = toy.simulate(1, seed=3)[1][0]
    renamed = ["new", *quick.x_names[1:]]
    for observed in (
        dict(zip(renamed, x.tolist(), strict=True)),
        Series(x, renamed),
        Frame(x[None], renamed),
        ObservedStatistics(x, tuple(renamed)),
        [x, ObservedStatistics(x, tuple(renamed))],
    ):
        for ask in (quick.posterior, quick.misfit):
            with pytest.raises(ObservationError, match="x_obs lacks s0; the model has no new$"):
                ask(observed)
    with pytest.raises(ObservationError, match="lacks s0, .*, s5 and 10 more; the model has no m"):
        quick.posterior(Statistics(np.zeros(len(NAMES))))
    with pytest.raises(ObservationError, match="x_obs lacks s15$"):
        quick.posterior(dict(zip(quick.x_names[:-1], x[:-1].tolist(), strict=True)))
    with pytest.raises(ObservationError, match="s3 more than once"):
        quick.posterior(Series(np.r_[x, 1.0], [*quick.x_names, "s3"]))
    with pytest.raises(TypeError, match=r"x_obs\['s0'\] must be an array of real numbers"):
        quick.posterior({**dict(zip(quick.x_names, x.tolist(), strict=True)), "s0": True})
    with pytest.raises(ObservationError, match="as many values of each name"):
        quick.posterior({name: np.zeros(1 + (name == "s3")) for name in quick.x_names})


def test_a_model_whose_statistics_nobody_named_goes_by_position(toy):
    theta, x = toy.simulate(80, seed=1)
    model = BayesSim.fit(theta, x, toy.prior, **QUICK)
    expected = model.posterior(x[0]).sample(5)
    for observed in (Statistics(x[0]), Series(x[0], NAMES), Frame(x[:1], NAMES)):
        np.testing.assert_array_equal(model.posterior(observed).sample(5), expected)
    # A dict has no order that counts.
    with pytest.raises(ObservationError, match="x_obs lacks statistic_0"):
        model.posterior(dict(zip(NAMES, x[0].tolist(), strict=True)))


def test_columns_of_frames_are_matched_by_name(toy):
    theta, x = toy.simulate(80, seed=1)
    prior, names = toy.prior, [f"s{i}" for i in range(16)]
    turned = Frame(theta[:, ::-1], prior.names[::-1])
    pairs = TrainingPairs.gather(turned, Frame(x, names), prior=prior)
    np.testing.assert_array_equal(pairs.theta, theta)
    assert pairs.x_names == tuple(names)
    columns = dict(zip(prior.names, theta.T, strict=True)), dict(zip(names, x.T, strict=True))
    pairs = TrainingPairs.gather(*columns, prior=prior)
    np.testing.assert_array_equal(pairs.x, x)
    # Names that are given are those of the model, whichever the order of the columns.
    pairs = TrainingPairs.gather(theta, Frame(x[:, ::-1], names[::-1]), prior=prior, x_names=names)
    np.testing.assert_array_equal(pairs.x, x)
    pairs = TrainingPairs.gather(theta, Frame(x, names), prior=prior, x_names=NAMES)
    np.testing.assert_array_equal(pairs.x, x)
    assert pairs.x_names == NAMES
    plain = TrainingPairs.gather(
        Frame(theta, range(3)), Frame(x, range(16)), prior=prior, x_names=names
    )
    np.testing.assert_array_equal(plain.theta, theta)
    assert TrainingPairs.gather(theta, Frame(x, range(16)), prior=prior).x_names[0] == "statistic_0"
    with pytest.raises(TrainingDataError, match=r"theta lacks .*; the prior has no other"):
        BayesSim.fit(Frame(theta, ["other", *prior.names[1:]]), x, prior, **QUICK)


def test_a_check_matches_names(quick, toy):
    theta, x = toy.simulate(20, seed=3)
    expected = quick.check(theta, x, draw_count=20).posterior_losses
    turned = Frame(theta[:, ::-1], toy.prior.names[::-1]), Frame(x[:, ::-1], quick.x_names[::-1])
    np.testing.assert_array_equal(quick.check(*turned, draw_count=20).posterior_losses, expected)
    with pytest.raises(TrainingDataError, match="x lacks s0; the model has no other"):
        quick.check(theta, Frame(x, ["other", *quick.x_names[1:]]))
