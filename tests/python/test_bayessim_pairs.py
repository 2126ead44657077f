"""What a model learns from: rows of data sets, their prior, bad pairs and settings."""

from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from toy_models import QUICK  # noqa: E402

from granulcal.bayessim import BayesSim, Config  # noqa: E402
from granulcal.bayessim.check.toys import LinearGaussian  # noqa: E402
from granulcal.bayessim.network.standardise import Standardiser  # noqa: E402
from granulcal.bayessim.training.pairs import TrainingPairs  # noqa: E402
from granulcal.errors import (  # noqa: E402
    NotOfPriorWarning,
    TrainingDataError,
)
from granulcal.parameter import Parameter  # noqa: E402
from granulcal.pours.scene import Scene  # noqa: E402
from granulcal.prior import Prior  # noqa: E402

BOUNDED = LinearGaussian.random(seed=1, noise=2.0, bounded=True)
THETA, X = Prior.default().sample(80, seed=0), np.random.default_rng(0).random((80, 16))


def test_a_data_set_is_not_learnt_under_another_prior(toy):
    theta, x = toy.simulate(60, seed=1)
    data = SimpleNamespace(theta=theta, x=x, prior=toy.prior, theta_names=toy.prior.names)
    wide = Prior(
        Parameter(path=name, distribution="normal", mean=0.0, sd=9.0) for name in toy.prior.names
    )
    with pytest.raises(TrainingDataError, match="drawn from another prior"):
        BayesSim.fit(data, prior=wide, **QUICK)
    fixed = Prior(
        [
            *toy.prior.free[:2],
            Parameter(path=toy.prior.names[2], distribution="fixed", value=0.0),
        ]
    )
    with pytest.raises(TrainingDataError, match="which the prior fixes"):
        BayesSim.fit(data, prior=fixed, proposal=toy.prior, **QUICK)


def test_a_check_needs_pairs(quick, toy):
    theta, x = toy.simulate(20, seed=3)
    with pytest.raises(TrainingDataError, match="at least 10 usable pairs"):
        quick.check(theta[:1], x[:1])
    with pytest.raises(TrainingDataError, match="as many rows"):
        quick.check(theta, x[:15])
    with pytest.raises(ValueError, match="draw_count must be at least 1, got 0"):
        quick.check(theta, x, draw_count=0)
    theta[3, 0] = np.nan
    with pytest.raises(TrainingDataError, match="NaN or infinite in 1"):
        quick.check(theta, x)


def test_data_set_rows_are_excluded_counted_and_reordered(toy, capsys):
    theta, x = toy.simulate(200, seed=5)
    status = ["at_rest"] * 200
    status[3], status[4], status[5], status[6], status[7] = (
        "unhealthy",
        "no_grains_in_view",
        "horizon",
        "out_of_view",
        "jammed",
    )
    theta[4], x[9, 2] = np.nan, np.inf
    data = SimpleNamespace(
        theta=np.column_stack([np.full(200, 7.0), theta[:, ::-1]]),
        theta_names=["scene.other", *toy.prior.names[::-1]],
        x=x,
        status=status,
        prior=toy.prior,
        scene_toml="a = 1\n",
    )
    options = {**QUICK, "quiet": False}
    model = BayesSim.fit(data, **options)
    assert model.summary.excluded == {
        "repeated": 0,
        "unhealthy": 1,
        "jammed": 1,
        "no_grains_in_view": 1,
        "non_finite": 1,
    }
    assert model.summary.pair_count == 200
    assert model.summary.horizon_count == 1
    assert model.scene_toml == "a = 1\n"
    printed = capsys.readouterr().out
    assert (
        "1 unhealthy, 1 jammed, 1 no_grains_in_view, 1 non_finite" in printed
        and "90% region holds" in printed
    )
    keep = np.setdiff1d(np.arange(200), [3, 4, 7, 9])
    same = BayesSim.fit(theta[keep], x[keep], toy.prior, **QUICK)
    np.testing.assert_array_equal(model.posterior(x[0]).sample(5), same.posterior(x[0]).sample(5))


def test_constant_statistics_are_noted_and_harmless(toy):
    theta, x = toy.simulate(100, seed=5)
    x[:, 4] = 2.5
    for method in ("emulated", "mdrff", "plain"):
        model = BayesSim.fit(theta, x, toy.prior, **{**QUICK, "method": method})
        assert "statistic_4" in model.summary.notes[0]
        assert np.all(np.isfinite(model.posterior(x[0]).sample(50)))


def test_a_pair_that_has_all_of_the_spread_is_named(toy):
    theta, x = toy.simulate(80, seed=1)
    assert not BayesSim.fit(theta, x, toy.prior, **QUICK).summary.notes
    x[7, 4] = -1e12
    (note,) = BayesSim.fit(theta, x, toy.prior, **QUICK).summary.notes
    assert "one pair has nearly all of the spread of statistic_4 (9 sd)" in note


def test_wide_positive_statistics_are_taken_in_logarithms():
    generator = np.random.default_rng(0)
    x = np.column_stack([np.exp(3 * generator.standard_normal(500)), generator.random(500)])
    standardiser = Standardiser.fit(x)
    assert standardiser.is_log.tolist() == [True, False]
    z = standardiser.apply(x)
    np.testing.assert_allclose([z.mean(0), z.std(0)], [[0, 0], [1, 1]], atol=1e-9)
    assert np.all(np.isfinite(standardiser.apply(np.array([[-1.0, 99.0]]))))


def test_parameters_that_were_not_drawn_from_the_prior_are_told(capsys):
    theta = BOUNDED.prior.sample(80, seed=5)
    theta[:, 1] = 0.4 * theta[:, 1]
    x, name = BOUNDED.simulate_at(theta, seed=2), BOUNDED.prior.names[1]
    with pytest.warns(NotOfPriorWarning, match=f"not drawn from the prior.*: {name}") as warned:
        model = BayesSim.fit(theta, x, BOUNDED.prior, **{**QUICK, "quiet": False})
    assert warned[0].filename == __file__
    (note,) = model.summary.notes
    assert note == str(warned[0].message) and f"note: {note}" in capsys.readouterr().out
    # Who says what they were drawn from is believed.
    model = BayesSim.fit(theta, x, BOUNDED.prior, proposal=BOUNDED.prior, **QUICK)
    assert model.summary.notes == ()


def test_a_proposal_whose_pairs_are_worth_little_of_the_prior_is_told(capsys):
    first = BOUNDED.prior.free[0]
    low, high = first.bounds
    sd = 0.07 * (high - low)
    near = Parameter(
        path=first.path, distribution="normal", mean=low + 4 * sd, sd=sd, low=low, high=high
    )
    proposal = Prior([near, *BOUNDED.prior.parameters[1:]])
    theta = proposal.sample(300, seed=5)
    x = BOUNDED.simulate_at(theta, seed=2)
    quick = {**QUICK, "quiet": False, "method": "emulated"}
    model = BayesSim.fit(theta, x, BOUNDED.prior, proposal=proposal, **quick)
    (note,) = model.summary.notes
    assert note.startswith("the 300 pairs of the proposal are worth "), note
    assert f"note: {note}" in capsys.readouterr().out


def test_few_pairs_of_the_prior_do_not_choose_a_network():
    """By pairs of the proposal alone the network was chosen, whose 90 % regions held 69 %."""
    path, low, high = "a.b", 0.0, 1.0
    even = Parameter(path=path, distribution="uniform", low=low, high=high)
    near = Parameter(path=path, distribution="normal", mean=0.5, sd=0.15, low=low, high=high)
    prior, proposal = Prior([even]), Prior([near])
    generator = np.random.default_rng(1)
    theta = proposal.sample(500, seed=1)
    x = theta + 0.3 * generator.standard_normal(theta.shape)
    quick = {**QUICK, "method": "auto", "max_epochs": 60, "patience": 10}
    model = BayesSim.fit(theta, x, prior, seed=1, proposal=proposal, **quick)
    assert model.summary.method == "emulated"
    assert any("worth" in note for note in model.summary.notes)


@pytest.mark.parametrize(("own", "here"), [([0.25], "at 0.25"), ([], "nowhere")])
def test_a_proposal_of_another_fixed_number_is_refused(own, here):
    """The posterior had been told under the prior's number, which no pair was of."""
    theta, x = BOUNDED.simulate(80, seed=5)

    def with_fixed(values):
        more = [Parameter(path="c.d", distribution="fixed", value=value) for value in values]
        return Prior([*BOUNDED.prior.parameters, *more])

    message = f"proposal fixes c.d at 0.5, the prior {here}"
    with pytest.raises(TrainingDataError, match=message):
        BayesSim.fit(theta, x, with_fixed(own), proposal=with_fixed([0.5]), **QUICK)


def test_a_prior_that_fixes_a_number_elsewhere_than_the_scene_of_a_proposal_is_refused():
    """The pairs are of the scene's number, for the proposal names none."""
    theta, x = BOUNDED.simulate(80, seed=5)
    scene, path = Scene.drop(0.02, count=60), "material.restitution"
    fixed = Parameter(path=path, distribution="fixed", value=0.25)
    prior = Prior([*BOUNDED.prior.parameters, fixed])
    message = "fixes material.restitution at 0.25, .*: the pairs are of the scene's 0.5"
    with pytest.raises(TrainingDataError, match=message):
        BayesSim.fit(theta, x, prior, proposal=BOUNDED.prior, scene=scene, **QUICK)
    BayesSim.fit(theta, x, prior, proposal=BOUNDED.prior, scene=scene.with_({path: 0.25}), **QUICK)


def test_a_proposal_that_leaves_a_part_of_the_prior_out_is_refused():
    """Its weights are all the same: the narrower posterior passed for the prior's and its check."""
    first = BOUNDED.prior.free[0]
    low, high = first.bounds
    for share, is_refused in ((0.6, True), (0.995, False)):
        cut = Parameter(
            path=first.path, distribution="uniform", low=low, high=low + share * (high - low)
        )
        proposal = Prior([cut, *BOUNDED.prior.parameters[1:]])
        theta = proposal.sample(80, seed=5)
        x = BOUNDED.simulate_at(theta, seed=2)
        if is_refused:
            message = f"proposal has {first.path} from -1 to 1.4 only, and 40% of the prior"
            with pytest.raises(TrainingDataError, match=message):
                BayesSim.fit(theta, x, BOUNDED.prior, proposal=proposal, **QUICK)
        else:
            BayesSim.fit(theta, x, BOUNDED.prior, proposal=proposal, **QUICK)


def test_pours_that_cannot_be_used_were_drawn_from_the_prior(toy):
    """Rows that are left out because of what they are make no other prior of the rest."""
    for drawn in (toy, BOUNDED):
        theta, x = drawn.simulate(400, seed=5)
        kept = theta[:, 0] <= np.median(theta[:, 0])
        status = np.where(kept, "at_rest", "unhealthy").tolist()
        pairs = TrainingPairs.gather(theta, x, prior=drawn.prior, status=status)
        assert pairs.not_of_prior == {} and len(pairs.theta) == kept.sum()
        found = TrainingPairs.gather(theta[kept], x[kept], prior=drawn.prior).not_of_prior
        assert list(found) == drawn.prior.names[:1] and found[drawn.prior.names[0]] < 1e-4


def test_a_data_set_was_drawn_from_its_prior(small_data):
    pairs = TrainingPairs.gather(small_data, fewest=1)
    assert pairs.not_of_prior == {}


def test_pairs_outside_of_a_narrower_prior_are_left_out():
    theta, x = BOUNDED.simulate(400, seed=5)
    first = BOUNDED.prior.free[0]
    low, high = first.bounds
    cut = Parameter(path=first.path, distribution="uniform", low=low, high=low + 0.6 * (high - low))
    narrow = Prior([cut, *BOUNDED.prior.parameters[1:]])
    data = SimpleNamespace(theta=theta, x=x, prior=BOUNDED.prior)
    model = BayesSim.fit(data, prior=narrow, proposal=data.prior, **QUICK)
    outside = int(np.sum(theta[:, 0] > cut.bounds[1]))
    assert model.summary.excluded["outside_prior"] == outside > 100
    assert f"{outside} outside_prior" in str(model.summary)
    assert model.calibration is not None
    with pytest.raises(TrainingDataError, match=f"{outside} rows outside"):
        BayesSim.fit(theta, x, narrow, **QUICK)
    few = theta[:, 0] > cut.bounds[1] - 0.01 * (high - low)
    with pytest.raises(TrainingDataError, match="at least 50 .* outside_prior"):
        BayesSim.fit(theta[few], x[few], narrow, proposal=data.prior, **QUICK)


@pytest.mark.parametrize(
    ("arguments", "options", "error", "message"),
    [
        ((THETA[:20], X[:20], Prior.default()), {}, TrainingDataError, "at least 50 .* got 20"),
        ((THETA, X[:70], Prior.default()), {}, TrainingDataError, "as many rows, got 80 and 70"),
        ((THETA[:, :2], X, Prior.default()), {}, TrainingDataError, "one column for each"),
        ((THETA, X[:, 0], Prior.default()), {}, TrainingDataError, r"got \(80,\)"),
        ((THETA, X, None), {}, TrainingDataError, "no prior"),
        ((THETA, X, "uniform"), {}, TypeError, "prior must be a Prior, got str"),
        ((THETA + 5, X, Prior.default()), {}, TrainingDataError, "80 rows outside"),
        ((THETA * np.nan, X, Prior.default()), {}, TrainingDataError, "NaN or infinite in 80"),
        ((THETA, X * np.nan, Prior.default()), {}, TrainingDataError, "80 non_finite"),
        ((THETA.astype(str), X, Prior.default()), {}, TypeError, "theta must be .* real"),
        ((THETA, X > 0.5, Prior.default()), {}, TypeError, "dtype bool"),
        ((THETA,), {}, TypeError, "without theta"),
        (("pours",), {}, TypeError, "one str without theta: gc.Dataset.load reads what"),
        ((THETA, X, Prior.default()), {"status": ["asleep"] * 80}, TrainingDataError, "asleep"),
        ((THETA, X, Prior.default()), {"status": ["at_rest"]}, TrainingDataError, "80 entries"),
        ((THETA, X, Prior.default()), {"x_names": ["a"]}, TrainingDataError, "1 x_names"),
        ((THETA, X, Prior.default()), {"x_names": ["a"] * 16}, TrainingDataError, "a more than"),
        (
            (THETA * [1, 1, 0] + [0, 0, 0.5], X, Prior.default()),
            {},
            TrainingDataError,
            r"material\.restitution is the same in all 80",
        ),
        ((THETA, X, Prior.default(), -1), {}, ValueError, "seed must be"),
        ((THETA, X, Prior.default()), {"scene": 3}, TypeError, "scene must be"),
        (
            (THETA, X, Prior.default()),
            {"scene": "count = 3\n"},
            TrainingDataError,
            "scene: .* field `count`",
        ),
        ((THETA, X, Prior.default()), {"scene": "drop"}, TrainingDataError, "scene: .*not valid"),
        ((THETA, X, Prior.default()), {"epochs": 3}, ValueError, "unknown option epochs"),
    ],
)
def test_bad_training_data(arguments, options, error, message):
    with pytest.raises(error, match=f"(?s){message}"):
        BayesSim.fit(*arguments, quiet=True, **options)


@pytest.mark.parametrize(
    "options",
    [
        {"components": 0},
        {"components": 2.5},
        {"components": (3, 0)},
        {"components": ()},
        {"ensemble": True},
        {"kernel": "linear"},
        {"method": "best"},
        {"learning_rate": 0.0},
        {"jitter": float("nan")},
        {"validation_share": 0.9},
        {"test_share": -0.1},
        {"length_scale": float("inf")},
        {"snr": 1},
    ],
)
def test_bad_settings_are_named(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        Config.from_options(**options)
