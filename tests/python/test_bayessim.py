"""BayesSim: features, training against exact posteriors, reproducibility, files, bad input."""

import io
import json
import pickle
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from signed import sign  # noqa: E402

from granulcal.bayessim import BayesSim, Config  # noqa: E402
from granulcal.bayessim.check.diagnostics import binomial_band  # noqa: E402
from granulcal.bayessim.check.toys import LinearGaussian, PileStandIn  # noqa: E402
from granulcal.bayessim.network.features import draw_frequencies, fourier_features  # noqa: E402
from granulcal.bayessim.network.network import HeadLayout  # noqa: E402
from granulcal.bayessim.network.standardise import Standardiser  # noqa: E402
from granulcal.bayessim.network.trainer import Progress  # noqa: E402
from granulcal.bayessim.posterior.posterior import OutOfRange, Posterior  # noqa: E402
from granulcal.bayessim.training.pairs import TrainingPairs  # noqa: E402
from granulcal.errors import (  # noqa: E402
    ModelFormatError,
    NotOfPriorWarning,
    ObservationError,
    TrainingDataError,
)
from granulcal.parameter import Parameter  # noqa: E402
from granulcal.pours.scene import Scene  # noqa: E402
from granulcal.pours.statistics import NAMES, ObservedStatistics, Statistics  # noqa: E402
from granulcal.prior import Prior  # noqa: E402

QUICK = {"quiet": True, "method": "mdrff", "max_epochs": 3, "ensemble": 2, "features": 20}
SCENE = Scene.drop(0.02, count=3).to_toml()
KERNELS = {
    "matern12": lambda r: np.exp(-r),
    "matern32": lambda r: (1 + np.sqrt(3) * r) * np.exp(-np.sqrt(3) * r),
    "matern52": lambda r: (1 + np.sqrt(5) * r + 5 * r**2 / 3) * np.exp(-np.sqrt(5) * r),
    "rbf": lambda r: np.exp(-(r**2) / 2),
}


@pytest.fixture(scope="module")
def toy():
    return LinearGaussian.random(seed=1, noise=2.0)


@pytest.fixture(scope="module")
def models(toy):
    theta, x = toy.simulate(1000, seed=20)
    return {
        method: BayesSim.fit(theta, x, toy.prior, quiet=True, method=method)
        for method in ("auto", "emulated", "mdrff")
    }


@pytest.fixture(scope="module")
def trained(models):
    return models["emulated"]


@pytest.fixture(scope="module")
def quick(toy):
    theta, x = toy.simulate(120, seed=1)
    names = [f"s{i}" for i in range(16)]
    return BayesSim.fit(theta, x, toy.prior, x_names=names, scene=SCENE, **QUICK)


@pytest.mark.parametrize("kernel", KERNELS)
def test_features_approximate_the_kernel(kernel: str):
    frequencies = draw_frequencies(16_384, 3, kernel=kernel, seed=0)
    x = torch.randn(60, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    features = fourier_features(x, frequencies)
    distances = torch.cdist(x, x).numpy()
    error = (features @ features.T).numpy() - KERNELS[kernel](distances)
    # Plain Monte Carlo with as many frequencies: root mean square 0.005, at most about 0.02.
    assert np.abs(error).max() < 0.015
    assert np.sqrt(np.mean(error**2)) < 0.004


def test_training_density_is_the_mixture_density():
    layout = HeadLayout(components=4, dimension=3)
    outputs = torch.randn(5, layout.size, generator=torch.Generator().manual_seed(0)).double()
    u = torch.randn(5, 3, generator=torch.Generator().manual_seed(1)).double()
    mixtures = layout.mixtures(outputs)
    prior = Prior(
        Parameter(path=f"n.{i}", distribution="normal", mean=0.0, sd=1.0) for i in range(3)
    )
    expected = [
        Posterior.from_mixture(prior, m).density.log_prob(row[None].numpy())[0]
        for m, row in zip(mixtures, u, strict=True)
    ]
    np.testing.assert_allclose(layout.log_density(outputs, u).numpy(), expected, rtol=1e-10)


# The prior's own divergence from these posteriors is about 4 nat.
@pytest.mark.parametrize(("method", "most"), [("auto", 0.1), ("emulated", 0.1), ("mdrff", 0.25)])
def test_close_to_the_exact_posterior(toy, models, method, most):
    x = toy.simulate(60, seed=400)[1]
    divergences = []
    for row in x:
        exact, ours = toy.posterior(row), models[method].posterior(row)
        draws = exact.sample(300, seed=1)
        divergences.append(np.mean(exact.log_prob(draws) - ours.log_prob(draws)))
    assert np.mean(divergences) < most


def test_several_pours_are_close_to_the_exact_posterior(toy, trained):
    theta = toy.prior.from_unconstrained([[0.3, -0.5, 0.8]])
    x = toy.simulate_at(np.repeat(theta, 4, axis=0), seed=3)
    exact, ours, single = toy.posterior(x), trained.posterior(x), trained.posterior(x[0])
    draws = exact.sample(1000, seed=1)
    assert np.mean(exact.log_prob(draws) - ours.log_prob(draws)) < 0.6
    assert np.all(ours.sample(2000).std(axis=0) < 0.75 * single.sample(2000).std(axis=0))


def test_pours_of_two_materials_are_outside_though_a_third_has_their_mean(toy, trained):
    one = toy.prior.from_unconstrained([[0.3, -0.5, 0.8]])
    generator = np.random.default_rng(0)
    inside = []
    for seed in range(40):
        theta = toy.prior.from_unconstrained(generator.standard_normal((1, 3)))
        inside.append(
            trained.misfit(toy.simulate_at(np.repeat(theta, 3, axis=0), seed=seed)).is_inside
        )
    assert np.mean(inside) >= 0.85
    other = toy.prior.from_unconstrained([[-1.7, 1.5, -1.2]])
    mixed = trained.misfit(toy.simulate_at(np.repeat([one[0], other[0]], 2, axis=0), seed=1))
    assert mixed.scatter_p_value is not None and mixed.scatter_p_value <= 0.01
    assert not mixed.is_inside and "differ more from each other than pours of one" in str(mixed)
    assert trained.misfit(toy.simulate_at(one, seed=1)).scatter_p_value is None


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


def test_own_calibration_check_is_stored_and_holds(toy, trained):
    assert trained.calibration.test_count == 240
    assert trained.calibration.posterior_loss < trained.calibration.prior_loss - 2
    # They were left out in turn, and chose the form, which the check says.
    assert "240 pours, each by a fit without it" in str(trained.calibration)
    assert "check --data" in str(trained.calibration)
    theta, x = toy.simulate(200, seed=500)
    assert "50 pours it had not seen" in str(trained.check(theta[:50], x[:50], draw_count=50))
    # Over four levels bands of 95 % raise one false alarm in seven, and training rounds
    # differently on every machine.
    for count in trained.check(theta, x, draw_count=300).coverage.counts:
        low, high = binomial_band(count.total, count.level, probability=0.999)
        assert low <= count.inside <= high, count


def test_emulator_beats_the_network_and_the_network_the_plain_recipe():
    pile = PileStandIn(seed=0)
    theta, x = pile.simulate(500, seed=1)
    new_theta, new_x = pile.simulate(150, seed=2)
    losses = {
        method: BayesSim.fit(theta, x, pile.prior, quiet=True, method=method)
        .check(new_theta, new_x, draw_count=50)
        .posterior_loss
        for method in ("emulated", "mdrff", "plain")
    }
    exact = -np.mean(pile.exact_log_prob(new_theta[:50], new_x[:50]))
    assert exact < losses["emulated"] < losses["mdrff"] - 0.1 < losses["plain"] - 0.3


def test_a_distilled_network_imitates_the_emulator(toy, trained):
    """A mixture trained on an emulator's draws: near the exact posterior and near its teacher."""
    theta, x = toy.simulate(300, seed=20)
    model = BayesSim.fit(theta, x, toy.prior, quiet=True, method="distilled", synthetic=5000)
    assert model.summary.method == "distilled" and model.amortised is not None
    found = []
    for row in toy.simulate(40, seed=400)[1]:
        exact, ours = toy.posterior(row), model.posterior(row)
        teacher = Posterior.from_conditions(
            toy.prior, [(model.likelihood, model.standardiser.apply(row[None]))]
        )
        draws, taught = exact.sample(200, seed=1), teacher.sample(200, seed=1)
        found.append(
            (
                np.mean(exact.log_prob(draws) - ours.log_prob(draws)),
                np.mean(teacher.log_prob(taught) - ours.log_prob(taught)),
            )
        )
    # The prior's own divergence is about 4 nat.
    assert np.all(np.mean(found, axis=0) < 0.4), np.mean(found, axis=0)


def test_same_seed_same_model_on_any_thread_count(toy):
    theta, x = toy.simulate(120, seed=1)
    state, threads = torch.random.get_rng_state(), torch.get_num_threads()
    first = BayesSim.fit(theta, x, toy.prior, **QUICK)
    try:
        torch.set_num_threads(2)
        again = BayesSim.fit(theta, x, toy.prior, **QUICK)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(threads)
    other = BayesSim.fit(theta, x, toy.prior, seed=1, **QUICK)
    draws = [model.posterior(x[0]).sample(20) for model in (first, again, other)]
    np.testing.assert_array_equal(draws[0], draws[1])
    assert not np.array_equal(draws[0], draws[2])
    assert torch.equal(state, torch.random.get_rng_state())


def test_save_and_load_are_identical_to_the_bit(quick, toy, tmp_path):
    quick.save(tmp_path / "model")
    quick.save(tmp_path / "model")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["model"]
    loaded = BayesSim.load(tmp_path / "model")
    sent = pickle.loads(pickle.dumps(quick))
    assert repr(sent) == repr(quick) and repr(sent).endswith(f"{quick.summary.pair_count} pours)")
    x = toy.simulate(3, seed=8)[1]
    for observed in (x[0], x):
        ours, theirs = quick.posterior(observed), loaded.posterior(observed)
        np.testing.assert_array_equal(ours.sample(50), theirs.sample(50))
        np.testing.assert_array_equal(ours.sample(50), sent.posterior(observed).sample(50))
        np.testing.assert_array_equal(
            ours.log_prob(ours.sample(5)), theirs.log_prob(ours.sample(5))
        )
    assert str(loaded.calibration) == str(quick.calibration)
    assert loaded.calibration is not None and quick.calibration is not None
    assert loaded.calibration.as_dict() == quick.calibration.as_dict()
    assert (loaded.x_names, loaded.scene_toml) == (quick.x_names, SCENE)
    assert loaded.scene_hash == quick.scene_hash
    loaded.save(tmp_path / "again")
    for name in ("model.json", "weights.safetensors"):
        first, second = (tmp_path / folder / name for folder in ("model", "again"))
        assert first.read_bytes() == second.read_bytes()


def test_models_say_whether_the_check_chose_their_form(models, quick, tmp_path):
    def chose_form(model: BayesSim) -> bool:
        assert model.calibration is not None
        return model.calibration.chose_form

    said = {method: chose_form(model) for method, model in models.items()}
    assert said == {"auto": True, "emulated": True, "mdrff": False}
    assert not chose_form(quick)
    # Files of before it was stated: where an emulator counts, its folds were the check.
    for model, expected in ((models["emulated"], True), (quick, False)):
        folder = tmp_path / str(expected)
        model.save(folder)
        assert chose_form(BayesSim.load(folder)) is expected
        document = json.loads((folder / "model.json").read_text())
        assert document["calibration"].pop("chose_form") is expected
        _edit_json(folder, calibration=document["calibration"])
        assert chose_form(BayesSim.load(folder)) is expected


def _edit_json(folder, **changes):
    path = folder / "model.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))
    sign(folder)


def _cut(folder, name):
    path = folder / name
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _drop_entry(folder):
    document = json.loads((folder / "model.json").read_text())
    del document["prior_toml"]
    (folder / "model.json").write_text(json.dumps(document))
    sign(folder)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (
            lambda f: _edit_json(f, version=99, made_by="granulcal 9.9"),
            r"version must be 3 or 4 \(granulcal .*got 99 \(made by granulcal 9.9\): update",
        ),
        (lambda f: _edit_json(f, version=2), "got 2 .*train the model again"),
        (lambda f: _edit_json(f, format="other"), "is not a granulcal-bayessim file"),
        (
            lambda f: _edit_json(f, x_names=["one"]),
            "axis_count must be at most 1",
        ),
        (lambda f: _edit_json(f, config={"colour": 3}), "config.colour must be absent"),
        (lambda f: _edit_json(f, config={}), "config.method must be there"),
        (lambda f: _edit_json(f, prior_toml="[["), "not valid TOML"),
        (_drop_entry, "prior_toml must be there"),
        (lambda f: _cut(f, "model.json"), "truncated or not JSON"),
        (lambda f: _cut(f, "weights.safetensors"), "truncated"),
    ],
)
def test_damaged_files_are_named(quick, tmp_path, damage, message):
    quick.save(tmp_path / "model")
    damage(tmp_path / "model")
    with pytest.raises(ModelFormatError, match=message):
        BayesSim.load(tmp_path / "model")


def test_missing_files_and_foreign_folders(quick, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"model\.json"):
        BayesSim.load(tmp_path / "nothing")
    quick.save(tmp_path / "model")
    (tmp_path / "model" / "weights.safetensors").unlink()
    with pytest.raises(FileNotFoundError, match=r"weights\.safetensors"):
        BayesSim.load(tmp_path / "model")
    shutil.rmtree(tmp_path / "model")
    (tmp_path / "model").mkdir()
    (tmp_path / "model" / "diary.txt").write_text("dear diary")
    with pytest.raises(FileExistsError, match="not a saved model"):
        quick.save(tmp_path / "model")
    assert (tmp_path / "model" / "diary.txt").exists()


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


def test_progress_is_reported(toy):
    theta, x = toy.simulate(60, seed=5)
    seen: list[Progress] = []
    BayesSim.fit(theta, x, toy.prior, progress=seen.append, **QUICK)
    assert [p.epoch for p in seen] == [1, 2, 3] and seen[0].max_epochs == 3


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


BOUNDED = LinearGaussian.random(seed=1, noise=2.0, bounded=True)


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


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_fit_shows_how_far_it_is_in_a_terminal_alone(toy, capsys, monkeypatch):
    theta, x = toy.simulate(120, seed=1)
    loud = {**QUICK, "quiet": False}
    shown = {}
    for kind, stream, options in (
        ("terminal", Terminal(), loud),
        ("quiet", Terminal(), QUICK),
        ("file", io.StringIO(), loud),
    ):
        with monkeypatch.context() as patch:
            patch.setattr("sys.stderr", stream)
            BayesSim.fit(theta, x, toy.prior, **options)
        shown[kind] = stream.getvalue()
    assert all(f"{part} 0/" in shown["terminal"] for part in ("emulator", "network", "check"))
    assert shown["quiet"] == shown["file"] == ""
    assert "\r" not in capsys.readouterr().out


THETA, X = Prior.default().sample(80, seed=0), np.random.default_rng(0).random((80, 16))


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
