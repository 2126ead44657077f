"""Plans of rings: heights from radii, what is out of reach, pours of a plan, the command."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import granulcal

import granulcal as gc
from granulcal import _native
from granulcal.design.pattern import Pattern, simulate_plan
from granulcal.design.reach import Reach
from granulcal.design.ring import STATISTICS
from granulcal.design.ring_model import (
    HEIGHT,
    RingModel,
    _is_trained,
    height_prior,
    observing_radii,
)
from granulcal.errors import ExtrapolationError, TrainingDataError, UnreachableRingError
from granulcal.pours.left_out import LeftOut

pytest.importorskip("torch")

_EXAMPLES = Path(__file__).parents[2] / "examples"
_NOISE = 5e-4


class _Line:
    """A data set in which radius = a + b height, with noise."""

    def __init__(self, count: int = 200) -> None:
        generator = np.random.default_rng(3)
        self.scene = observing_radii(gc.Scene.funnel(count=100))
        self.scene_toml = self.scene.to_toml()
        self.prior = height_prior((0.01, 0.13))
        self.theta_names, self.x_names = (HEIGHT,), STATISTICS
        self.theta = generator.uniform(0.01, 0.13, (count, 1))
        noise = generator.normal(scale=_NOISE, size=(count, 2))
        self.x = self.radii(self.theta) + noise
        self.status = np.full(count, "at_rest")
        self.is_usable = np.ones(count, bool)
        self.left_out = LeftOut()
        self.law, self.base_seed = _native.LAW, 0

    @staticmethod
    def radii(heights):
        return np.column_stack([0.01 + 0.3 * heights, 0.03 + 0.5 * heights])

    def __len__(self) -> int:
        return len(self.theta)


@pytest.fixture(scope="module")
def line() -> RingModel:
    data = _Line()
    return RingModel(gc.BayesSim.fit(data, quiet=True, method="emulated"), data)  # pyright: ignore


def _at(height: float) -> gc.Ring:
    inner, outer = _Line.radii(np.array([height]))[0]
    return gc.Ring(outer=outer, inner=inner)


class _Bow(_Line):
    """Radii that two heights give alike."""

    @staticmethod
    def radii(heights):
        outer = 0.05 + 0.03 * np.sin(np.pi * (heights - 0.01) / 0.12)
        return np.column_stack([0.4 * outer, outer])


def test_a_ring_that_two_heights_give_has_one_of_them():
    """The mean of both had been said to be the nearest, and that no height gives the ring."""
    data = _Bow()
    model = RingModel(gc.BayesSim.fit(data, quiet=True, method="emulated"), data)  # pyright: ignore
    for height in (0.03, 0.05, 0.1):
        inner, outer = _Bow.radii(np.array([height]))[0]
        plan = gc.design_rings(model, [gc.Ring(outer=outer, inner=inner)])
        (pour,), (note,) = plan.pours, plan.notes
        assert min(abs(pour.height - h) for h in (height, 0.14 - height)) < 3e-3
        assert pour.expected_outer == pytest.approx(outer, abs=5e-4)
        assert "more than one height" in note


def test_height_of_a_closed_form_is_returned(line):
    for height in (0.02, 0.07, 0.12):
        (pour,) = gc.design_rings(line, [_at(height)]).pours
        assert pour.height == pytest.approx(height, abs=3e-3)
        assert pour.height_low < height < pour.height_high
        assert pour.expected_outer == pytest.approx(0.03 + 0.5 * height, abs=1e-3)
        assert pour.outer_sd == pytest.approx(_NOISE, rel=0.5)
        assert not pour.is_extrapolated


def test_least_error_of_a_height_is_that_of_the_noise(line):
    expected = _NOISE / np.hypot(0.3, 0.5)
    assert line.reach.at(0.07).floor == pytest.approx(expected, rel=0.25)
    checked = line.check(_Line(100))
    assert checked.errors.std() < 1.5 * expected
    assert checked.coverage > 0.7
    assert "100 pours" in str(checked)


def test_a_pile_needs_no_inner_radius(line):
    (pour,) = gc.design_rings(line, [gc.Ring(outer=0.05)]).pours
    assert pour.wanted_inner is None
    assert pour.height == pytest.approx(0.04, abs=3e-3)


def test_the_widest_is_poured_first(line):
    plan = gc.design_rings(line, [_at(0.02), _at(0.12), _at(0.07)])
    assert [p.order for p in plan.pours] == [1, 2, 3]
    heights = [p.height for p in plan.pours]
    assert heights == sorted(heights, reverse=True)


def test_extrapolation_is_refused_or_flagged(line):
    with pytest.raises(ExtrapolationError, match=r"heights of 1\.\d to 1[23]\.\d cm .* 27\.\d cm"):
        gc.design_rings(line, [_at(0.271)])
    plan = gc.design_rings(line, [_at(0.271), _at(0.05)], extrapolate=True)
    assert [p.is_extrapolated for p in plan.pours] == [True, False]
    assert plan.pours[0].height == pytest.approx(0.271, abs=0.02)
    assert plan.is_extrapolated
    assert "pour 1 is extrapolated" in plan.notes[0]
    with pytest.raises(ExtrapolationError, match="at no height"):
        gc.design_rings(line, [gc.Ring(outer=0.005)], extrapolate=True)


@pytest.mark.parametrize(("outer", "inner"), [(0.1, None), (0.2, None), (0.1, 0.04), (0.2, 0.08)])
def test_a_ring_wider_than_where_the_radii_turn_is_at_no_height(
    outer: float, inner: float | None
) -> None:
    """The tangent at the lowest height had led among the pours, or past the highest of them."""
    data = _Bow()
    model = RingModel(gc.BayesSim.fit(data, quiet=True, method="emulated"), data)  # pyright: ignore
    for extrapolate in (False, True):
        with pytest.raises(ExtrapolationError, match="the trend at its end leads away from it"):
            gc.design_rings(model, [gc.Ring(outer=outer, inner=inner)], extrapolate=extrapolate)


def test_radii_that_no_height_gives_are_refused(line):
    with pytest.raises(UnreachableRingError, match=r"the nearest, .* give from 1\.\d+ / 3\.\d+ to"):
        gc.design_rings(line, [gc.Ring(outer=0.08, inner=0.07)])
    # All that cannot be had are named at once, and that the others can.
    both = [gc.Ring(outer=0.08, inner=0.07), _at(0.271)]
    with pytest.raises(ExtrapolationError, match=r"lies outside the training.*; no height gives"):
        gc.design_rings(line, both)
    with pytest.raises(ExtrapolationError, match="; without them there is a plan for the rest"):
        gc.design_rings(line, [*both, _at(0.05)])
    with pytest.raises(ValueError, match="at least one ring"):
        gc.design_rings(line, [])
    with pytest.raises(ValueError, match="tolerance must be positive, got 0"):
        gc.design_rings(line, [_at(0.05)], tolerance=0)


@pytest.mark.parametrize(("outer", "inner"), [(-0.1, None), (73, None), (0.05, 0.06), (0.05, 0.0)])
def test_a_ring_that_cannot_be(outer, inner):
    with pytest.raises(ValueError, match=r"must (be a positive radius|lie between)"):
        gc.Ring(outer=outer, inner=inner)


def test_plan_files_are_read_back(line, tmp_path):
    plan = gc.design_rings(line, [_at(0.1), gc.Ring(outer=0.05)])
    plan.save(tmp_path)
    assert gc.Plan.load(tmp_path) == plan
    rows = list(csv.DictReader((tmp_path / "plan.csv").read_text().splitlines()))
    assert [float(row["height"]) for row in rows] == [p.height for p in plan.pours]
    assert rows[1]["wanted_inner"] == ""
    (tmp_path / "plan.json").write_text('{"format": 1}')
    with pytest.raises(ValueError, match="damaged or not a pour plan"):
        gc.Plan.load(tmp_path)


def test_reach_follows_a_curve():
    heights = np.linspace(0.01, 0.13, 120)
    noise = np.random.default_rng(0).normal(scale=1e-4, size=(120, 2))
    radii = np.column_stack([heights**2, np.sin(10 * heights)]) + noise
    reach = Reach(heights, radii)
    found = reach.at(0.08)
    np.testing.assert_allclose(found.radii, [0.0064, np.sin(0.8)], atol=3e-4)
    np.testing.assert_allclose(found.slope, [0.16, 10 * np.cos(0.8)], rtol=0.1)
    with pytest.raises(TrainingDataError, match="at least 20 usable pours"):
        Reach(heights[:5], radii[:5])


def test_scenes_that_do_not_fit_are_refused():
    assert observing_radii(gc.Scene.funnel()).observed_names == STATISTICS
    with pytest.raises(ValueError, match=r"observes radius\[10\]"):
        observing_radii(gc.Scene.load(_EXAMPLES / "bowl.toml"))
    with pytest.raises(ValueError, match=r"funnel\.height"):
        observing_radii(gc.Scene.drop(0.02))


def test_later_pours_keep_the_grains_of_earlier_ones(line):
    plan = gc.design_rings(line, [_at(0.12), _at(0.05)])
    pattern = simulate_plan(plan, seed=1)
    assert pattern.positions.shape == (200, 3)
    assert np.bincount(pattern.pour).tolist() == [100, 100]
    alone = gc.simulate(line.scene.with_({HEIGHT: plan.pours[0].height}), seed=1)
    outer = np.percentile(np.hypot(*alone.positions[:, :2].T), 50)
    # The second pour moves some of the first's grains, and none far.
    assert pattern.rings[0, 1] == pytest.approx(outer, rel=0.25)
    assert pattern.is_whole


def test_a_plan_of_a_volume_has_all_its_grains(line):
    """Two rings had failed there, after all their pours."""
    volume = 30 * np.pi / 6 * 0.004**3
    text = line.scene.to_toml().replace("count = 100", f"volume = {volume:.9e}")
    plan = replace(gc.design_rings(line, [_at(0.12), _at(0.05)]), scene_toml=text)
    pattern = simulate_plan(plan, seed=1)
    assert np.bincount(pattern.pour).tolist() == [30, 30]


def test_a_plan_of_grains_that_differ_is_of_one_ring(line, tmp_path):
    mixed = line.scene.with_({"effects.polydispersity.cv": 0.1, "grains.count": 20})
    plan = replace(gc.design_rings(line, [_at(0.12), _at(0.05)]), scene_toml=mixed.to_toml())
    with pytest.raises(ValueError, match=r"effects\.polydispersity must be left out"):
        simulate_plan(plan)
    one = simulate_plan(replace(plan, pours=plan.pours[:1]))
    assert np.ptp(one.radii) > 0
    (tmp_path / "scene.toml").write_text(mixed.to_toml())
    words = ["rings", str(tmp_path / "scene.toml"), "--pile", "0.1", "--pile", "0.05"]
    refused = granulcal("design", *words, "-o", str(tmp_path / "plan"))
    assert refused.returncode == 2 and "effects.polydispersity" in refused.stderr
    # Before any pour.
    assert not (tmp_path / "plan").exists()


def test_unhealthy_pours_and_posteriors_outside_end_with_3(capsys):
    from granulcal.commands.design import _code

    assert _code(LeftOut(jammed=3), True) == 0
    assert capsys.readouterr().err == ""
    assert _code(LeftOut(unhealthy=1), True) == 3
    assert "1 unhealthy" in capsys.readouterr().err
    assert _code(LeftOut(), False) == 3


def test_a_pour_that_jams_is_told():
    grains = np.zeros((2, 3)), np.full(2, 1e-3), np.array([0, 1])
    pattern = Pattern(*grains, ("at_rest", "jammed"), np.zeros((2, 2)), gc.Scene.funnel())
    assert not pattern.is_whole
    assert [note.split(":")[0] for note in pattern.notes] == ["pour 2 jams"]


def test_pours_of_the_training_are_no_check(line):
    with pytest.raises(ValueError, match="200 of the 200 pours .* trained on: another seed"):
        line.check(_Line())


def test_a_model_of_another_material_is_not_taken_for_ones_own(tmp_path):
    scene = observing_radii(gc.Scene.funnel(count=60, preset="fast"))
    prior = height_prior((0.08, 0.13))
    other = scene.with_({"material.sliding_friction": 0.1})
    one, two = (gc.generate(each, prior, 3, seed=2, progress=False) for each in (scene, other))
    # Heights of one seed are the same.
    assert np.array_equal(one.theta, two.theta)
    one.save(tmp_path / "training.parquet")
    assert _is_trained(tmp_path, one) and not _is_trained(tmp_path, two)


def test_a_plans_picture_tells_of_grains_beyond_it(line: RingModel, monkeypatch, tmp_path) -> None:
    """Of 150 grains 45 lay outside, and the histogram said nothing of them."""
    from granulcal.design import picture

    plan = gc.design_rings(line, [gc.Ring(outer=0.06)])
    kept = []
    monkeypatch.setattr(picture, "save_figure", lambda figure, *_, **__: kept.append(figure))
    reach = np.linspace(0.0, 0.15, 30)
    positions = np.column_stack([reach, np.zeros(30), np.full(30, 2e-3)])
    pattern = Pattern(
        positions=positions,
        radii=np.full(30, 2e-3),
        pour=np.zeros(30, int),
        statuses=("at_rest",),
        rings=np.zeros((1, 2)),
        scene=line.scene,
    )
    picture.plan_picture(plan, pattern, tmp_path / "plan.png")
    labels = [text.get_text() for text in kept[0].axes[1].get_legend().get_texts()]
    beyond = int((reach > 3.2 * 0.06 / 2).sum())
    assert labels[0].endswith(f"; {beyond} of 30 grains farther out")


def test_command_trains_plans_and_resumes(tmp_path):
    out = tmp_path / "plan"
    words = ["rings", "funnel", "--set", "grains.count=60", "--heights", "0.05", "0.13"]
    words += ["--pours", "60", "-o", str(out)]
    done = granulcal("design", *words, "--held-out", "5")
    assert done.returncode == 0, done.stderr
    assert "height of 5 pours" in done.stdout
    model = RingModel.load(out)
    outer = float(model.reach.at(0.09).radii[1])
    done = granulcal("design", *words, "--pile", str(outer), "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert 0.05 < document["pours"][0]["height"] < 0.13
    assert document["trained"]["pours"] == 60
    assert (out / "plan.png").read_bytes().startswith(b"\x89PNG")
    assert gc.Plan.load(out).pours[0].height == document["pours"][0]["height"]
    refused = granulcal("design", *words, "--pile", "2.0")
    assert refused.returncode == 2
    assert "lies outside the training" in refused.stderr
    refused = granulcal(
        "design", "rings", str(out), "--set", "grains.count=60", "--pile", "0.1", "-o", str(out)
    )
    assert "a trained model has its material" in refused.stderr
    assert granulcal("design", *words).returncode == 2
    # With seed 5 the pours of the training are those of the check by 4.
    data = gc.Dataset.load(out / "model" / "training.parquet")
    again = gc.generate(data.scene, data.prior, 60, seed=5, out=tmp_path / "pours", progress=False)
    gc.BayesSim.fit(again, quiet=True, method="emulated").save(tmp_path / "other")
    again.save(tmp_path / "other" / "training.parquet")
    checked = ["rings", str(tmp_path / "other"), "--seed", "4", "--held-out", "3"]
    done = granulcal("design", *checked, "-o", str(tmp_path / "check"))
    assert done.returncode == 0, done.stderr
    held_out = gc.Dataset.load(tmp_path / "check" / "held-out")
    assert not np.isin(held_out.theta, again.theta).any()
    with pytest.raises(ValueError, match="seed must be another than that of the training's pours"):
        RingModel.load(tmp_path / "other").held_out(3, seed=5)
