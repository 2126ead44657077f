"""The files of predictions: which rows they have, and what stands in them."""

from pathlib import Path

import numpy as np
import pytest

from granulcal.experiments.predictions import columns, reproduce, write_csv
from granulcal.experiments.predictions.columns import column_rows, observing, read_tests, times_of
from granulcal.experiments.predictions.drum import SPEEDS, drum_rows
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


def test_fronts_are_poured_and_what_needs_no_physics_is_scaled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
    assert all("corrected" in line for line in told) and len(told) == 4
    table = {(row[0], row[1], row[2]): [float(str(v)) for v in row[3:]] for row in rows}
    # The nearest condition of 1 g is the second; 0.15 s lie between its times.
    near = {
        float(str(t)): row[0]
        for (m, code, t), row in table.items()
        if t != "end" and (m, code) == ("nearest", "a_08g")
    }
    assert near[min(near, key=lambda t: abs(t - 0.15))] == pytest.approx(65.0)
    at = next(key for key in table if key[:2] == ("nearest", "c_06g") and key[2] != "end")
    assert float(str(at[2])) >= 0.05 and table["line", "c_06g", "end"][0] == pytest.approx(80.0)
    for model in ("base", "named"):
        end = table[model, "a_08g", "end"]
        assert 10 < end[1] <= end[0] <= end[2] < 300
        assert sum(key[:2] == (model, "a_08g") for key in table) == 17


def test_drum_rows_have_every_speed_and_say_what_is_refused(tmp_path: Path) -> None:
    rate = 2 * np.pi / 60
    inputs = (("walls.0.motion.rate", 15 * rate, 45 * rate),)
    told: list[str] = []
    means = np.array([[0.01, 0.0, -0.01, 40.0], [0.02, 0.0, -0.02, 52.0]])
    made = models(Scene.from_toml(DRUM), inputs, means)
    profiles, slopes = drum_rows(made, tmp_path, say=told.append)
    line = {row[1]: row[2] for row in slopes if row[0] == "line"}
    assert line == pytest.approx({10: 38.0, 20: 42.0, 30: 46.0, 60: 58.0})
    assert [row[2] for row in profiles if row[:2] == ("line", 30)] == pytest.approx([-4, 0, 4])
    # This scene has no walls that turn: models that pour have nothing to say, and it is said.
    assert {row[0] for row in slopes} == {"line", "nearest"}
    assert sum("no prediction" in line for line in told) == 3 * len(SPEEDS)


def test_loops_that_were_not_closed_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="granulcal reproduce loop_drum makes it"):
        reproduce(tmp_path, tmp_path)
    write_csv(tmp_path / "a.csv", ("model", "x"), [("base", 1 / 3), ("line", 2)])
    assert (tmp_path / "a.csv").read_text() == "model,x\nbase,0.33333\nline,2\n"
