"""BayesSim: features, training against exact posteriors, reproducibility, progress."""

import io
import json

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from toy_models import QUICK, edit_json  # noqa: E402

from granulcal.bayessim import BayesSim  # noqa: E402
from granulcal.bayessim.check.diagnostics import binomial_band  # noqa: E402
from granulcal.bayessim.check.toys import PileStandIn  # noqa: E402
from granulcal.bayessim.network.features import draw_frequencies, fourier_features  # noqa: E402
from granulcal.bayessim.network.network import HeadLayout  # noqa: E402
from granulcal.bayessim.network.trainer import Progress  # noqa: E402
from granulcal.bayessim.posterior.posterior import Posterior  # noqa: E402
from granulcal.parameter import Parameter  # noqa: E402
from granulcal.prior import Prior  # noqa: E402

KERNELS = {
    "matern12": lambda r: np.exp(-r),
    "matern32": lambda r: (1 + np.sqrt(3) * r) * np.exp(-np.sqrt(3) * r),
    "matern52": lambda r: (1 + np.sqrt(5) * r + 5 * r**2 / 3) * np.exp(-np.sqrt(5) * r),
    "rbf": lambda r: np.exp(-(r**2) / 2),
}


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


def test_any_seed_that_is_taken_has_features() -> None:
    """From 2^63 on, over the members of an ensemble from 2^61, it was "Overflow when unpacking"."""
    most = draw_frequencies(8, 3, kernel="rbf", seed=5 * (2**64 - 1))
    assert not np.array_equal(most, draw_frequencies(8, 3, kernel="rbf", seed=2**64 - 1))


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


def test_one_pour_of_another_material_among_ten_is_named(toy, trained):
    generator = np.random.default_rng(1)
    called, named, told, x = 0, 0, "", np.empty((0, 0))
    for seed in range(40):
        theta = toy.prior.from_unconstrained(0.7 * generator.standard_normal((1, 3)))
        x = toy.simulate_at(np.repeat(theta, 10, axis=0), seed=seed)
        called += trained.misfit(x).odd_pour is not None
        other = toy.prior.from_unconstrained([[-2.0, 2.0, -2.0]])
        x[seed % 10] = toy.simulate_at(other, seed=seed)[0]
        found = trained.misfit(x)
        odd, told = found.odd_pour, str(found)
        named += odd is not None and odd.number == seed % 10 + 1
    assert called <= 2 and named >= 30
    assert "Pour 10 is odd: it lies" in told and told.endswith("Is it one of them?")
    assert trained.misfit(x[:2]).odd_pour is None


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
        edit_json(folder, calibration=document["calibration"])
        assert chose_form(BayesSim.load(folder)) is expected


def test_progress_is_reported(toy):
    theta, x = toy.simulate(60, seed=5)
    seen: list[Progress] = []
    BayesSim.fit(theta, x, toy.prior, progress=seen.append, **QUICK)
    assert [p.epoch for p in seen] == [1, 2, 3] and seen[0].max_epochs == 3


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
