"""Spilled grains: counts that vary more than chance, forecasts, the command."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import granulcal
from scipy import stats

import granulcal as gc
from granulcal.bayessim.network.mixture import Mixture
from granulcal.design.count_model import CountModel, beta_binomial_tail, log_gamma
from granulcal.design.posterior_file import PosteriorDraws
from granulcal.design.spill import forecast_of
from granulcal.pours.kept_pours import KeptPours

pytest.importorskip("torch")

_EXAMPLES = Path(__file__).parents[2] / "examples"


def test_tail_of_a_beta_binomial_is_scipys():
    share = np.array([1e-4, 0.01, 0.3, 0.9])
    x = np.array([1e-5, 0.5, 3.0, 50.0, 1e6])
    from scipy.special import gammaln

    np.testing.assert_allclose(log_gamma(x), gammaln(x), rtol=1e-12, atol=1e-12)
    for rho in (1e-5, 0.01, 0.2):
        size = 1 / rho - 1
        for least in (1, 7, 60):
            expected = stats.betabinom.sf(least - 1, 200, share * size, (1 - share) * size)
            found = beta_binomial_tail(least, 200, share, rho)
            np.testing.assert_allclose(found, expected, atol=1e-8)
    assert beta_binomial_tail(0, 10, share, 0.1).tolist() == [1.0] * 4
    assert beta_binomial_tail(11, 10, share, 0.1).tolist() == [0.0] * 4


def test_curve_of_a_known_binomial_is_found():
    generator = np.random.default_rng(1)
    heights = generator.uniform(0.05, 0.3, 300)
    share = 1 / (1 + np.exp(6 - 12 * heights))
    counts = generator.binomial(500, share).astype(float)
    forecast = forecast_of(heights, np.empty((300, 0)), counts, 500, grains=(1, 5, 20))
    assert forecast.rho < 1e-3
    truth = 1 / (1 + np.exp(6 - 12 * forecast.heights))
    np.testing.assert_allclose(forecast.expected, 500 * truth, rtol=0.25)
    for i, k in enumerate(forecast.grains):
        expected = stats.binom.sf(k - 1, 500, truth)
        np.testing.assert_allclose(forecast.probability[i], expected, atol=0.06)
        assert np.all(forecast.low[i] <= forecast.high[i])
        inside = (forecast.low[i] - 0.01 <= expected) & (expected <= forecast.high[i] + 0.01)
        assert inside.mean() > 0.8


def test_the_json_of_a_spill_answers_at_most(tmp_path, capsys):
    """With --json the answer to --at-most stood nowhere."""
    from granulcal.cli import main

    bowl, out = _small_bowl(tmp_path / "bowl.toml"), tmp_path / "spill"
    words = ["design", "-q", "spill", str(bowl), "--heights", "0.1", "0.4", "--pours", "24"]
    words += ["--grains", "1", "59", "--at-most", "0.2", "-o", str(out), "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((out / "spill.json").read_text()) and told["at_most"] == 0.2
    for each in told["probabilities"]:
        within = np.maximum(each["probability"], each["interval90"][1]) <= 0.2
        last = len(within) if within.all() else int(np.argmin(within))
        assert each["highest"] == (told["heights"][last - 1] if last else None)


def test_seven_numbers_of_grains_are_seven_lines(monkeypatch, tmp_path):
    """The seventh had the colour of the first, and the legend lay over the curves."""
    from granulcal.design import forecast as drawn

    kept: list[Any] = []
    monkeypatch.setattr(drawn, "save_figure", lambda figure, *_, **__: kept.append(figure))
    heights = np.linspace(0.05, 0.3, 40)
    counts = np.round(200 * heights)
    found = forecast_of(heights, np.empty((40, 0)), counts, 500, grains=range(1, 8))
    found.plot(tmp_path / "spill.png")
    figure = kept[0]
    figure.canvas.draw()
    chances = figure.axes[1]
    looks = {(line.get_color(), line.get_linestyle()) for line in chances.lines}
    assert len(looks) == len(chances.lines) == 7
    legend = figure.legends[0].get_window_extent()
    assert not chances.get_window_extent().overlaps(legend)
    assert legend.x1 <= figure.bbox.width


def test_more_spread_than_chance_is_seen():
    generator = np.random.default_rng(2)
    heights, rho = generator.uniform(0.05, 0.3, 300), 0.01
    size = 1 / rho - 1
    share = 1 / (1 + np.exp(5 - 12 * heights))
    counts = generator.binomial(500, generator.beta(share * size, (1 - share) * size))
    model = CountModel.fit(heights, np.empty((300, 0)), counts.astype(float), 500)
    assert 0.6 * rho < model.rho < 1.6 * rho


@pytest.mark.parametrize("all_spill", [False, True])
@pytest.mark.parametrize("drawn", [0, 2])
def test_pours_that_never_spill_or_always_leave_little_doubt(all_spill, drawn):
    """A normal about the estimate had given P(>= 1) of 0.07 to 0.2 after 200 clean pours."""
    total, count = 200, 200
    heights = np.linspace(0.06, 0.3, count)
    material = np.random.default_rng(1).normal(size=(count, drawn))
    counts = np.full(count, float(total if all_spill else 0))
    forecast = forecast_of(heights, material, counts, total, grains=(1, total))
    rare = 1 - forecast.probability[1] if all_spill else forecast.probability[0]
    assert rare.max() < 0.015
    # And some: 200 pours exclude no chance of a thousandth.
    assert rare.max() > 1e-5


def test_draws_are_those_of_the_posterior():
    """By quadrature over both coefficients and rho, with one pour of ten that spills a grain."""
    heights = np.linspace(0.1, 0.2, 10)
    counts = np.zeros(10)
    counts[7] = 1
    model = CountModel.fit(heights, np.empty((10, 0)), counts, 50, degrees=(1,))
    drawn, rho = model.draw(1000, np.random.default_rng(0))
    axes = np.linspace(-25, 0, 80), np.linspace(-15, 15, 80), np.linspace(1e-3, 0.5**0.5, 60)
    level, slope, root = np.meshgrid(*axes, indexing="ij")
    share = 1 / (1 + np.exp(-(level[..., None] + slope[..., None] * model.rows[:, 1])))
    size = 1 / root[..., None] ** 2 - 1
    log = stats.betabinom.logpmf(counts, 50, share * size, (1 - share) * size).sum(axis=-1)
    log -= 0.5 * (level / 20) ** 2 + 0.5 * (slope / 5) ** 2
    weight = np.exp(log - log.max())
    found_of = ((level, drawn[:, 0]), (slope, drawn[:, 1]), (root, np.sqrt(rho)))
    for values, found in found_of:
        mean = np.average(values, weights=weight)
        sd = np.average((values - mean) ** 2, weights=weight) ** 0.5
        assert found.mean() == pytest.approx(mean, abs=0.1 * sd)
        assert found.std() == pytest.approx(sd, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("pours", "rho"), [(40, 0.05), (100, 0.05), (25, 0.1)])
def test_bands_hold_the_truth(pours, rho):
    """Of known curves; with rho at its largest likelihood k = 10 was held in .6 to .7 of cases."""
    total, size, sets, grains = 100, 1 / rho - 1, 60, (1, 10)
    asked = sets * len(grains)
    held, unsafe, advised = [], 0, 0
    for seed in range(sets):
        generator = np.random.default_rng(seed)
        heights = np.linspace(0.06, 0.3, pours)
        share = 1 / (1 + np.exp(4 - 2 * (2 * (heights - 0.06) / 0.24 - 1)))
        counts = generator.binomial(total, generator.beta(share * size, (1 - share) * size))
        known = np.empty((pours, 0))
        forecast = forecast_of(heights, known, counts * 1.0, total, grains=grains, seed=seed)
        share = 1 / (1 + np.exp(4 - 2 * (2 * (forecast.heights - 0.06) / 0.24 - 1)))
        for i, k in enumerate(forecast.grains):
            truth = stats.betabinom.sf(k - 1, total, share * size, (1 - share) * size)
            held.append(np.mean((forecast.low[i] <= truth) & (truth <= forecast.high[i])))
            top = forecast.highest(k, 0.1)
            if top is not None:
                advised += 1
                unsafe += truth[np.argmin(np.abs(forecast.heights - top))] > 0.1
    print(f"{pours} pours, rho {rho}: held {np.mean(held):.3f}, ", end="")
    print(f"unsafe {unsafe} of {advised} advised, of {asked} asked")
    assert np.mean(held) > 0.8
    # 5 % are promised; three standard errors.
    assert unsafe < (0.05 + 3 * np.sqrt(0.05 * 0.95 / asked)) * asked


def test_unknown_material_widens_the_band():
    generator = np.random.default_rng(4)
    heights, material = generator.uniform(0.05, 0.3, 300), generator.normal(size=(300, 1))
    share = 1 / (1 + np.exp(5.5 - 8 * heights - material[:, 0]))
    counts = generator.binomial(500, share).astype(float)
    known = np.empty((300, 0))
    drawn = forecast_of(heights, material, counts, 500, grains=(10,), names=("material.friction",))
    blind = forecast_of(heights, known, counts, 500, grains=(10,))
    assert np.mean(drawn.high - drawn.low) > 3 * np.mean(blind.high - blind.low)
    # Both see the same pours: what the one calls material is pour-to-pour noise to the other.
    assert drawn.rho < 0.3 * blind.rho
    top = drawn.highest(10, 0.05)
    assert top is None or top < 0.2


def _small_bowl(path: Path) -> Path:
    scene = gc.Scene.load(_EXAMPLES / "bowl.toml").with_({"grains.count": 60, "preset": "fast"})
    path.write_text(scene.to_toml())
    return path


def test_spill_command_resumes_and_writes(tmp_path):
    bowl, out = _small_bowl(tmp_path / "bowl.toml"), tmp_path / "spill"
    posterior = tmp_path / "posterior.json"
    names = ["material.sliding_friction", "material.restitution"]
    draws = np.random.default_rng(0).uniform([0.3, 0.6], [0.7, 0.9], (50, 2))
    parameters = {name: {"mode": 0.65} for name in names}
    posterior.write_text(json.dumps({"parameters": parameters, "samples": draws.tolist()}))
    words = ["spill", str(bowl), "--heights", "0.1", "0.4", "--pours", "24", "--grains", "1", "5"]
    words += ["--posterior", str(posterior), "-o", str(out)]
    done = granulcal("design", *words)
    assert done.returncode == 0, done.stderr
    assert "24 pours of 60 grains" in done.stdout
    assert "P(spilled >= 1)" in done.stdout
    assert "spill.csv and spill.json (metres)" in done.stdout
    kept = (out / "pours.json").read_text()
    document = json.loads(kept)
    del document["pours"]["7"]
    # Without its hash, which would find the change.
    del document["hash"]
    (out / "pours.json").write_text(json.dumps(document))
    before = (out / "spill.csv").read_text()
    assert granulcal("design", *words).returncode == 0
    again = json.loads((out / "pours.json").read_text())["pours"]
    timeless = [
        {i: {**row, "cpu_s": None} for i, row in pours.items()}
        for pours in (again, json.loads(kept)["pours"])
    ]
    assert timeless[0] == timeless[1]
    assert (out / "spill.csv").read_text() == before
    assert granulcal("design", *words, "--pours", "26").returncode == 0
    more = json.loads((out / "pours.json").read_text())["pours"]
    assert len(more) == 26
    assert {i: more[i] for i in again} == again
    document = {"parameters": parameters, "samples": draws.tolist()}
    posterior.write_text(json.dumps({**document, "inside_model": {"is_inside": False}}))
    outside = granulcal("design", *words)
    assert outside.returncode == 3 and "OUTSIDE THE MODEL" in outside.stderr
    rows = list(csv.DictReader(before.splitlines()))
    assert all(0 <= float(row["low"]) <= float(row["high"]) <= 1 for row in rows)
    assert json.loads((out / "spill.json").read_text())["drawn"] == names
    assert (out / "spill.png").read_bytes().startswith(b"\x89PNG")


def test_spill_refuses_what_it_cannot_answer(tmp_path):
    bowl = gc.Scene.load(_EXAMPLES / "bowl.toml")
    with pytest.raises(ValueError, match=r"no \[observe\.spill\] table"):
        gc.design_spill(gc.Scene.funnel(), out=tmp_path)
    with pytest.raises(ValueError, match=r"grains must be from 1 to 2000, got \[0\]"):
        gc.design_spill(bowl, grains=[0], out=tmp_path)
    with pytest.raises(ValueError, match="heights must be positive and rising"):
        gc.design_spill(bowl, heights=(0.2, 0.1), out=tmp_path)
    with pytest.raises(ValueError, match="pours must be at least 20, got 3"):
        gc.design_spill(bowl, pours=3, out=tmp_path)
    posterior = {
        "parameters": {"material.sliding_friction": {"mode": 0.4}},
        "fixed": {"material.restitution": 0.3},
        "samples": [[0.4], [0.5]],
    }
    (tmp_path / "posterior.json").write_text(json.dumps(posterior))
    there = PosteriorDraws.load(tmp_path / "posterior.json").at_mode(gc.Scene.funnel())
    assert there.get("material.sliding_friction") == 0.4
    assert there.get("material.restitution") == 0.3
    (tmp_path / "none.json").write_text("{}")
    with pytest.raises(ValueError, match="parameters must be there"):
        PosteriorDraws.load(tmp_path / "none.json")


def _posterior() -> gc.Posterior:
    """Of one parameter, whose prior fixed another."""
    prior = gc.Prior(
        [
            gc.Parameter(
                path="material.sliding_friction", distribution="uniform", low=0.3, high=0.6
            ),
            gc.Parameter(path="material.restitution", distribution="fixed", value=0.35),
        ]
    )
    return gc.Posterior.from_mixture(
        prior, Mixture(np.ones(1), np.zeros((1, 1)), np.ones((1, 1, 1)))
    )


def test_draws_are_taken_from_a_posterior() -> None:
    posterior = _posterior()
    draws = PosteriorDraws.of(posterior)
    assert draws.names == ("material.sliding_friction",)
    assert draws.samples.shape == (1000, 1) and draws.mode == pytest.approx(posterior.mode())
    assert draws.fixed == {"material.restitution": 0.35}
    assert PosteriorDraws.of(draws) is draws
    with pytest.raises(TypeError, match=r"got str: PosteriorDraws\.load reads the one in a file"):
        PosteriorDraws.of("posterior.json")  # pyright: ignore[reportArgumentType]


def test_spill_takes_a_posterior_and_what_its_prior_fixed(tmp_path, monkeypatch):
    bowl = gc.Scene.load(_small_bowl(tmp_path / "bowl.toml"))
    poured = []

    class Kept(KeptPours):
        def __init__(self, scene: gc.Scene, *args: Any, **more: Any) -> None:
            poured.append(scene)
            super().__init__(scene, *args, **more)

    monkeypatch.setattr("granulcal.design.spill.KeptPours", Kept)
    forecast = gc.design_spill(
        bowl, heights=(0.1, 0.4), grains=(1,), pours=24, posterior=_posterior(), out=tmp_path,
        progress=False,
    )  # fmt: skip
    assert forecast.names == ("material.sliding_friction",)
    assert poured[0].get("material.restitution") == 0.35
