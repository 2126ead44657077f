"""The files of predictions: which rows they have, and what stands in them."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from granulcal.experiments import loop_drum
from granulcal.experiments.predictions import columns, drum_fit, write_csv
from granulcal.experiments.predictions.between_speeds import between_speeds
from granulcal.experiments.predictions.between_tests import BetweenTests, Told
from granulcal.experiments.predictions.column_tests import (
    Fronts,
    Test,
    observing,
    read_fronts,
    read_tests,
    times_of,
)
from granulcal.experiments.predictions.columns import column_rows
from granulcal.experiments.predictions.drum import SPEEDS, drum_rows
from granulcal.experiments.predictions.drum_base import SETTINGS, DrumBase
from granulcal.experiments.predictions.model_error import ModelError
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.models import Maker, Models
from granulcal.pours.scene import Scene

TABLE = """TestCode N rpm G r_0 d_p rho_p IF rho_f mu_f
a_08g 1 0 9.81 0.054 0.008 2632 w 1000 0.001
b_04g 1 0 9.81 0.054 0.004 2632 w 1000 0.001
c_06g 4 47 39.24 0.054 0.006 2671 g 1120 0.005
"""
SCENE = """
name = "column"
preset = "fast"
[grains]
count = 64
diameter = 8e-3
density = 2632.0
[start]
kind = "cylinder"
from = [0.0, 0.0, 0.0]
to = [0.0, 0.0, 0.08]
radius = 0.03
spacing = 9e-3
jitter = 2e-4
[observe]
rate = 240.0
[observe.front]
times = [0.1, 0.2, 0.3]
link = 1.5
[end]
horizon = 0.5
"""
DRUM = """
name = "drum"
[grains]
count = 60
diameter = 4e-3
density = 1300.0
[start]
kind = "grid"
counts = [5, 4, 3]
spacing = 6e-3
jitter = 5e-4
base = 0.02
[observe]
rate = 50.0
[observe.surface]
centre = [0.0, 0.06]
x = [-0.004, 0.0, 0.004]
slope_within = 0.004
[end]
horizon = 1.0
"""


def models(scene: Scene, inputs: tuple[tuple[str, float, float], ...], means: np.ndarray) -> Models:
    """Two conditions at both ends of the inputs; the named model has a fluid."""
    fluid = {"effects.fluid.density": 1.0, "effects.fluid.viscosity": 1e-5}
    return Models(
        scene=scene,
        verdict={"kind": "EFFECT", "named": ["fluid"]},
        paths=tuple(path for path, _, _ in inputs),
        inputs=inputs,
        names=tuple(scene.observed_names),
        makers={
            "base": (Maker({"material.restitution": 0.3}, {}, {}),) * 2,
            "named": (Maker({"material.restitution": 0.3, **fluid}, {}, {}),) * 2,
        },
        columns=(),
        transforms=(),
        correction=None,
        known=np.array([[0.0], [1.0]]),
        means=means,
        scatter=np.full(means.shape, 1e-3),
        pours=np.ones(2),
    )


def test_tests_are_those_with_large_beads(tmp_path: Path) -> None:
    path = tmp_path / "conditions.txt"
    path.write_text(TABLE)
    one, two = read_tests(path)
    assert (one.code, two.code) == ("a_08g", "c_06g")
    scene = Scene.from_toml(SCENE)
    numbers = two.scene_numbers(scene)
    assert numbers["grains.count"] == round(64 * (8 / 6) ** 3) and numbers["gravity.2"] == -39.24
    assert numbers["start.spacing"] == pytest.approx(9e-3 * 6 / 8)
    # Half a free fall at four g lasts half as long.
    assert times_of(one)[[0, -1]] == pytest.approx([0.025, 0.4])
    assert times_of(two)[[0, -1]] == pytest.approx([0.0125, 0.2])
    path.write_text(TABLE + "d 1 2\n")
    with pytest.raises(ValueError, match="line 5 must have 10 columns, got 3"):
        read_tests(path)


def test_a_scene_may_be_observed_at_other_times() -> None:
    scene = observing(Scene.from_toml(SCENE), np.array([0.05, 0.25]))
    assert scene.observed_names == (
        "front_radius[0.05]",
        "front_radius[0.25]",
        "front_radius[end]",
    )
    assert scene.get("observe.front.link") == 1.5


def test_fronts_are_poured_for_every_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(columns, "_POURS", 2)
    data = tmp_path / "measured"
    (data / "column-collapse-webb").mkdir(parents=True)
    (data / "column-collapse-webb" / "Experimental_Conditions.txt").write_text(TABLE)
    (tmp_path / "to-predict").mkdir()
    (tmp_path / "to-predict" / "columns.txt").write_text(TABLE.replace("_0", "_further_0"))
    scene = Scene.from_toml(SCENE)
    means = np.array([[0.05, 0.06, 0.07, 0.08], [0.06, 0.07, 0.08, 0.09]])
    told: list[str] = []
    rows = column_rows(
        models(scene, (("gravity.2", -39.24, -9.81),), means),
        tmp_path / "pours",
        data,
        say=told.append,
    )
    tests = {str(row[1]) for row in rows}
    assert tests == {"a_08g", "c_06g", "a_further_08g", "c_further_06g"}
    assert sum("corrected" in line for line in told) == 4
    # No front was measured: nothing is known of a model's error.
    assert sum("with an rms of nan mm" in line for line in told) == 2 and len(told) == 6
    table = {(row[0], row[1], row[2]): [float(str(v)) for v in row[3:]] for row in rows}
    for model in ("base", "named"):
        end = table[model, "a_08g", "end"]
        assert 10 < end[1] <= end[0] <= end[2] < 300
        assert sum(key[:2] == (model, "a_08g") for key in table) == 17


def test_a_residual_of_beads_moves_no_front_of_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(columns, "_POURS", 2)
    (tmp_path / "conditions.txt").write_text(TABLE)
    wide, narrow = read_tests(tmp_path / "conditions.txt")
    known = np.array([[0.0], [1.0]])
    nothing = Discrepancy(known, np.empty(0), np.empty(0), np.empty((0, 0)))
    scene, inputs = Scene.from_toml(SCENE), (("gravity.2", -39.24, -9.81),)
    its = replace(models(scene, inputs, np.full((2, 4), 0.06)), correction=nothing)
    forward, told = Forward(tmp_path / "pours", 1), list[str]()
    rows = columns._corrected(its, wide, forward, told.append)
    assert rows and not told
    assert columns._corrected(its, narrow, forward, told.append) == []
    assert told == [
        "columns, corrected of c_06g: no prediction: the fits are of beads of 8 mm, got 6"
    ]


def test_a_model_is_as_wide_as_it_was_off_on_other_days() -> None:
    (near, row), (far, _) = campaign(101, 1, 8e-3, 1e-3, 100), campaign(102, 1, 8e-3, 1e-3, 100)
    measured, middle = np.array(row), np.array(row) - 6.0
    measured[-1] = np.nan
    told = {test.code: Told(middle, middle, middle) for test in (near, far)}
    error = ModelError(Fronts((near,), measured[None]), told)
    there = error.widened(far, told[far.code])
    # 6 mm off at every time; the end was not seen and has the last known error.
    assert (there.high - there.middle) == pytest.approx(1.645 * 6.0)
    # Its own day says nothing of it.
    same = error.widened(near, told[near.code])
    assert (same.high - same.middle)[:-1] == pytest.approx(0.0)
    rms, share = error.held(told)
    assert rms == pytest.approx(6.0) and share == 0.0


def campaign(
    day: int, gravity: float, beads: float, viscosity: float, radius: float
) -> tuple[Test, list[float]]:
    """One test, whose front grows to `radius`."""
    numbers = {"N": gravity, "d_p": beads, "mu_f": viscosity, "G": 9.81 * gravity}
    return Test(f"2021{day:04d}_x", numbers), [*np.linspace(60.0, radius, 16), radius]


def plane(gravity: float, beads: float, viscosity: float) -> float:
    """A front that is a plane in what `line` knows."""
    thickness = np.log10(viscosity / np.sqrt(gravity) / 1e-3)
    return 120 + 20 * (1 - gravity**-0.5) + 10 * (8e-3 - beads) / 2e-3 - 12 * float(thickness)


def measured_plane() -> Fronts:
    """Twelve tests of as many days."""
    tests, rows = [], []
    for number in range(12):
        of = ((1.0, 4.0)[number % 2], (8e-3, 6e-3)[number // 2 % 2], 1e-3 * 3 ** (number // 4))
        test, row = campaign(101 + number, *of, plane(*of))
        tests.append(test)
        rows.append(row)
    return Fronts(tuple(tests), np.array(rows))


def test_a_plane_is_told_by_its_line_also_where_its_test_is_left_out() -> None:
    rows = BetweenTests(measured_plane())
    error, end, _ = rows.held("line")
    assert error < 1e-9 and end < 1e-9
    assert rows.held("nearest")[1] > 3 and rows.held("between")[1] < rows.held("nearest")[1]
    # A gravity that was not measured: the line goes on, and knows that it is farther off.
    test, row = campaign(301, 16.0, 8e-3, 4e-3, plane(16.0, 8e-3, 4e-3))
    told = rows.tell("line", test)
    assert told.middle == pytest.approx(row, abs=1e-6)
    within = rows.tell("line", campaign(302, 4.0, 8e-3, 2e-3, 0.0)[0])
    assert told.high[-1] - told.low[-1] > within.high[-1] - within.low[-1]


def test_intervals_hold_what_they_say() -> None:
    fronts, generator = measured_plane(), np.random.default_rng(3)
    # A day shifts all of its front.
    noisy = Fronts(fronts.tests, fronts.radius + 4.0 * generator.standard_normal((12, 1)))
    for model in ("nearest", "line", "between"):
        assert 0.8 < BetweenTests(noisy).held(model)[2] < 1.0, model


def test_a_test_has_no_part_in_its_own_prediction_and_none_is_told_out_of_view() -> None:
    fronts = measured_plane()
    moved = Fronts(fronts.tests, fronts.radius + 50.0 * (np.arange(12) == 3)[:, None])
    before, after = (
        BetweenTests(one).tell("nearest", fronts.tests[3]).middle for one in (fronts, moved)
    )
    assert before == pytest.approx(after)
    far = BetweenTests(Fronts(fronts.tests, fronts.radius + 90.0))
    assert far.tell("between", fronts.tests[0]).high.max() == 200.0


def test_a_front_that_leaves_the_view_goes_on_for_a_while(tmp_path: Path) -> None:
    folder = tmp_path / "column-collapse-webb"
    (folder / "runout").mkdir(parents=True)
    (folder / "Experimental_Conditions.txt").write_text(TABLE)
    # 0.2 m/s up to 0.25 s, one camera; 240 frames a second.
    lines = [f"{i} nan nan {0.06 + 0.2 * i / 240:.6f} 0.2 nan nan nan nan" for i in range(61)]
    (folder / "runout" / "a_08g.txt").write_text("\n".join(["names", *lines]) + "\n")
    fronts = read_fronts(tmp_path)
    assert [test.code for test in fronts.tests] == ["a_08g"]
    row = fronts.radius[0]
    assert row[:10] == pytest.approx(60 + 5 * np.arange(1, 11), abs=1e-3)
    assert row[10:13] == pytest.approx([115, 120, 125], abs=0.01)
    assert np.isnan(row[14:16]).all() and row[16] == pytest.approx(110.0)


def test_between_two_speeds_stands_a_line_and_its_interval_knows_other_forms() -> None:
    speeds, values = np.array([15.0, 45.0]), np.array([[0.01, 40.0], [0.02, 52.0]])
    for rpm, slope, least in ((10, 38.0, 1.0), (30, 46.0, 1.0), (60, 58.0, 2.0)):
        middle, low, high = between_speeds("line", speeds, values, rpm, [-0.02, None])
        assert middle[1] == pytest.approx(slope) and low[1] + least < slope < high[1] - least
    # n^2 through both gives 65 degrees at 60 rpm, and ln n 55.1.
    squared, logarithm = 40 + 12 * (3600 - 225) / 1800, 40 + 12 * np.log(4) / np.log(3)
    assert high[1] > squared > low[1] and high[1] > logarithm > low[1]
    near, *_ = between_speeds("nearest", speeds, values, 30, [-0.02, None])
    assert near == pytest.approx([0.015, 46.0])
    at_wall, _, high = between_speeds("line", speeds, values * 2, 60, [-0.028, None])
    assert at_wall[0] == high[0] == pytest.approx(np.sqrt(0.042**2 - 0.028**2))


class StatedDrum(DrumBase):
    """A drum that knows its surfaces, so that nothing is poured beforehand."""

    def fill(self, what: str, asked: object) -> None:
        pass


class BentDrum(StatedDrum):
    """A drum whose bed bends with the square of the speed, off by a line that it cannot know."""

    def at(self, setting: Mapping[str, float], rpm: float, begin: float, end: float) -> np.ndarray:
        return np.array([0.0, 30.0 + 2.0 * SETTINGS.index(setting) + 0.006 * rpm**2])


def test_a_base_model_with_its_own_residual_keeps_the_bend_that_a_line_lacks(
    tmp_path: Path,
) -> None:
    def truth(rpm: float) -> np.ndarray:
        return np.array([0.001 * rpm / 15, 33.0 + 0.1 * rpm + 0.006 * rpm**2])

    drum, speeds = BentDrum.__new__(BentDrum), np.array([15.0, 45.0])
    values = np.array([truth(15), truth(45)])
    for rpm in (10, 30, 60):
        told = drum.tell(SETTINGS, rpm, (0.0, 1.0), speeds, values, [0.0, None])
        middle, low, high = told["corrected"]
        assert middle == pytest.approx(truth(rpm)) and (low < truth(rpm)).all()
        assert (high > truth(rpm)).all()
        line, *_ = between_speeds("line", speeds, values, rpm, [0.0, None])
        assert abs(line[1] - truth(rpm)[1]) > 0.4
        base, low, high = told["base"]
        assert base[1] == pytest.approx(31.0 + 0.006 * rpm**2) and low[1] < base[1] < high[1]
    # Both settings bend alike, so that each tells the other without an error; a line does not.
    found = drum.held({rpm: (0.0, 1.0) for rpm in (10, 30)}, speeds, [0.0, None])
    assert found["corrected"] == pytest.approx((0.0, 0.0, 1.0), abs=1e-9)
    assert found["line"][1] == pytest.approx(0.006 * np.sqrt((175**2 + 225**2) / 2))


class SizedDrum(StatedDrum):
    """A drum whose surface is straight in the unknowns, and another one for larger grains."""

    def at(self, setting: Mapping[str, float], rpm: float, begin: float, end: float) -> np.ndarray:
        values = np.array([[setting[name] for name in drum_fit.UNKNOWN.names]])
        u = drum_fit.UNKNOWN.to_unconstrained(values)[0]
        if "grains.diameter" not in setting:
            if u[0] > 0.9:
                raise ValueError("no usable pour")
            u = u + np.array([0.15, -0.1, 0.0, 0.1])
        slope = 30.0 + 0.2 * rpm + 20 * u[0] + (10 + 0.1 * rpm) * u[1]
        return np.array([1e-2 * (u[3] + 0.02 * rpm * u[2]), 1e-2 * (u[3] - u[2]), slope])


def test_a_drum_is_fitted_at_the_true_size_through_larger_grains() -> None:
    drum, speeds = SizedDrum.__new__(SizedDrum), np.array([15.0, 45.0])
    drum.scene = loop_drum.task(Path("nowhere")).scene
    true = drum_fit.true_size(drum.scene)
    assert true["grains.diameter"] == 1.2e-3 and drum.scene.get("grains.diameter") == 1.7e-3
    assert true["start.spacing"] == pytest.approx(1.85e-3 * 1.2 / 1.7)
    truth = np.array([[0.4, 0.5, 0.6, 0.7]])
    named = drum_fit.UNKNOWN.from_unconstrained(truth)[0].tolist()
    at = {**dict(zip(drum_fit.UNKNOWN.names, named, strict=True)), **true}
    values = drum.pictured(at, speeds)
    told: list[str] = []
    is_slope = np.array([False, False, True])
    fit = drum_fit.DrumFit(drum, speeds, values, is_slope, say=told.append)
    # Larger grains alone would be off by 1 mm and 2 degrees; the rounds go on from there.
    first, *_, last = (float(line.rpartition(" ")[2]) for line in told)
    assert len(told) == drum_fit.ROUNDS and first > 10 * max(last, 0.1)
    best = drum.pictured(fit.settings[0], speeds)
    assert best == pytest.approx(values, abs=0.3) and len(fit.settings) == drum_fit.KEPT
    assert np.abs(best - values)[:, :2].max() < 4e-4


def test_a_drum_without_a_usable_pour_of_the_true_size_has_no_setting() -> None:
    class Unhealthy(SizedDrum):
        def at(
            self, setting: Mapping[str, float], rpm: float, begin: float, end: float
        ) -> np.ndarray:
            if "grains.diameter" in setting:
                raise ValueError("no usable pour")
            return super().at(setting, rpm, begin, end)

    drum, speeds = Unhealthy.__new__(Unhealthy), np.array([15.0, 45.0])
    drum.scene = loop_drum.task(Path("nowhere")).scene
    values, told = np.array([[0.01, 0.0, 40.0], [0.01, 0.0, 50.0]]), []
    is_slope = np.array([False, False, True])
    fit = drum_fit.DrumFit(drum, speeds, values, is_slope, say=told.append)
    assert fit.settings == () and "no usable pour; the fit ends here" in told[0]


def test_drum_models_that_have_nothing_to_say_are_named(tmp_path: Path) -> None:
    rate = 2 * np.pi / 60
    inputs = (("walls.0.motion.rate", 15 * rate, 45 * rate),)
    told: list[str] = []
    means = np.array([[0.01, 0.0, -0.01, 40.0], [0.02, 0.0, -0.02, 52.0]])
    made = models(Scene.from_toml(DRUM), inputs, means)
    # This scene has no walls that turn.
    assert drum_rows(made, tmp_path, say=told.append) == ([], [])
    assert sum("no prediction" in line for line in told) == 3 * len(SPEEDS)


def test_numbers_of_a_table_have_five_digits(tmp_path: Path) -> None:
    write_csv(tmp_path / "a.csv", ("model", "x"), [("base", 1 / 3), ("line", 2)])
    assert (tmp_path / "a.csv").read_text() == "model,x\nbase,0.33333\nline,2\n"
