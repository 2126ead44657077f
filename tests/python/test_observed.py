"""Statistics that a scene observes: of pours, in data sets, and measured."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granulcal as gc
from granulcal import _native
from granulcal.measured import DischargeCurve, DrumImage, NamedValues, RunOut

_OBSERVE = """
[observe]
rate = 100.0
begin = 0.0

[observe.front]
times = [0.1, 0.2]

[observe.discharge]
below = 0.0
times = [0.1, 0.2]

[observe.surface]
centre = [0.0, 0.0]
x = [-0.01, 0.0, 0.01]
slope_within = 0.008

[observe.radius]
percentiles = [50.0]

[observe.spill]
radius = 0.02
"""


@pytest.fixture
def scene() -> gc.Scene:
    """A small drop that observes everything."""
    return gc.Scene.from_toml(gc.Scene.drop(0.02, count=60).to_toml() + _OBSERVE)


def test_names_units_and_docs_come_from_the_scene(scene: gc.Scene) -> None:
    assert scene.observed_names == (
        "surface_z[-0.01]",
        "surface_z[0]",
        "surface_z[0.01]",
        "surface_slope",
        "front_radius[0.1]",
        "front_radius[0.2]",
        "front_radius[end]",
        "discharged[0.1]",
        "discharged[0.2]",
        "discharge_rate",
        "radius[50]",
        "spilled",
    )
    assert scene.observed_units["surface_slope"] == "deg"
    assert "0.2 s after the begin" in scene.observed_docs["front_radius[0.2]"]
    assert gc.Scene.drop(0.02).observed_names == ()


def test_a_pour_shows_what_its_scene_observes(scene: gc.Scene) -> None:
    pour = gc.simulate(scene, seed=1)
    observed = pour.observed()
    radii = np.sort(np.hypot(*pour.positions[:, :2].T))
    assert observed["radius[50]"] == pytest.approx(radii[29:31].mean(), rel=1e-12)
    assert observed["spilled"] == (radii > 0.02).sum()
    assert observed["discharged[0.2]"] == 0.0
    time, radius = pour.series("front_radius")
    assert time[0] == 0.0
    assert np.all(np.diff(time) > 0)
    assert observed["front_radius[0.1]"] == pytest.approx(np.interp(0.1, time, radius), abs=1e-4)
    with pytest.raises(KeyError, match="front_radius"):
        pour.series("height")
    assert len(gc.simulate(gc.Scene.drop(0.02, count=20)).observed()) == 0


def test_what_a_scene_observes_is_the_x_of_its_data_set(scene: gc.Scene, tmp_path: Path) -> None:
    kept = gc.Scene.from_toml(
        scene.to_toml().split("[observe")[0]
        + "[observe]\nrate = 100.0\n[observe.radius]\npercentiles = [10.0, 50.0, 90.0]\n"
    )
    data = gc.generate(kept, gc.Prior.default(), 3, seed=2, out=tmp_path / "d", progress=False)
    assert data.x_names == ("radius[10]", "radius[50]", "radius[90]")
    assert data.x.shape == (3, 3)
    assert data.paper16.shape == (3, 16)
    assert data.is_usable.all()
    assert (np.diff(data.x, axis=1) > 0).all()
    data.save(tmp_path / "one.parquet")
    again = gc.Dataset.load(tmp_path / "one.parquet")
    np.testing.assert_array_equal(again.x, data.x)
    assert list(again.columns())[-3:] == list(data.x_names)


def test_a_run_out_file_gives_the_fronts_of_the_scene(scene: gc.Scene, tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    rows = ["Frame r_f v_f r_p v_p r_f v_f r_p v_p"]
    for frame in range(60):
        radius = 0.05 + 0.001 * frame
        second = "nan" if frame < 10 else f"{radius + 0.002}"
        rows.append(f"{frame} {radius + 0.01} 0 {radius} 0 {radius + 0.01} 0 {second} nan")
    path.write_text("\n".join(rows) + "\n")
    observed = gc.Recording.observed(path, scene)
    # Frame 24 of 240 a second, mean of two cameras, which differ by less than a grain.
    assert observed["front_radius[0.1]"] == pytest.approx(0.05 + 0.024 + 0.001)
    assert observed["front_radius[end]"] == pytest.approx(0.05 + 0.059 + 0.001)
    assert np.isnan(observed["discharged[0.1]"])
    assert gc.Recording.observed(path, scene, fps=120.0)["front_radius[0.1]"] == pytest.approx(
        0.05 + 0.012 + 0.001
    )
    # Where one camera sees nothing yet there is no mean.
    assert np.isnan(RunOut.open(path).front_radius()[3])
    assert RunOut.open(path).disagreement() == pytest.approx(0.002)
    alone = gc.Recording.observed(path, scene, camera=2)
    assert alone["front_radius[0.1]"] == pytest.approx(0.05 + 0.024 + 0.002)
    path.write_text("Frame\n1 2 3\n")
    with pytest.raises(ValueError, match="line 2 must have 9 numbers, got 3"):
        gc.Recording.observed(path, scene)
    with pytest.raises(ValueError, match="takes fps and camera, not width"):
        gc.Recording.observed(path, scene, width=0.1)


def test_a_run_out_file_in_other_units_or_letters_is_told(tmp_path: Path) -> None:
    path = tmp_path / "run.txt"
    path.write_bytes("Größe der Front\n0 nan 0 0.05 0 nan 0 nan nan\n".encode("latin-1"))
    assert RunOut.open(path).front_radius().tolist() == [0.05]
    cases = {
        "Front\n0 nan 0 8 0 nan 0 nan 0\n1 nan 0 45 0 nan 0 nan 0": "line 3.* 45: is it in metres",
        "Front\n0 -0.05 0 0.05 0 nan 0 nan 0": "line 2: .* from 0 to 10 m, got -0.05",
        "0 nan 0 0.05 0 nan 0 nan 0\n1 nan 0 0.06 0 nan 0 nan 0": "run.txt: line 1 must be names",
    }
    for text, match in cases.items():
        path.write_text(text)
        with pytest.raises(ValueError, match=match):
            RunOut.open(path)


def run_out(particles: np.ndarray) -> RunOut:
    """Fronts of two cameras at 100 frames a second, the fluid 10 mm ahead."""
    time = 0.01 * np.arange(len(particles)).astype(np.float64)
    return RunOut(time=time, particles=particles, liquid=particles + 0.01, source="run.txt")


def test_a_camera_that_stops_makes_no_jump(scene: gc.Scene) -> None:
    steps = np.arange(41)[:, None]
    # Two cameras 3 mm apart; the second stops at 0.3 s.
    particles = 0.05 + 0.001 * steps + np.array([0.0, 0.003])
    particles[31:, 1] = np.nan
    found = run_out(particles)
    front = found.front_radius()
    assert np.diff(front[:31]) == pytest.approx(np.full(30, 0.001))
    assert np.isnan(front[31:]).all()
    # Each camera's own end: 90 and 83 mm.
    assert found.observed(scene)["front_radius[end]"] == pytest.approx(0.0865)
    assert found.observed(scene, camera=1)["front_radius[end]"] == pytest.approx(0.09)
    assert found.liquid_radius()[:31] == pytest.approx(front[:31] + 0.01)
    with pytest.raises(ValueError, match="camera must be 1 or 2, got 3"):
        found.observed(scene, camera=3)


def test_cameras_that_differ_by_more_than_a_grain_are_told(scene: gc.Scene) -> None:
    particles = 0.05 + 0.001 * np.arange(41)[:, None] + np.array([0.0, 0.006])
    with pytest.warns(UserWarning, match="run.txt: the cameras' fronts differ by up to 6 mm"):
        run_out(particles).observed(scene)
    # One that never saw a front differs from nothing, and is left out.
    particles[:, 1] = np.nan
    assert run_out(particles).observed(scene)["front_radius[0.1]"] == pytest.approx(0.06)


def test_a_file_without_a_front_is_named(scene: gc.Scene) -> None:
    nothing = np.full((20, 2), np.nan)
    with pytest.raises(ValueError, match="run.txt: no front of particles was tracked$"):
        run_out(nothing).observed(scene)
    nothing[:, 0] = 0.05
    with pytest.raises(ValueError, match="no front of particles was tracked by camera 2"):
        run_out(nothing).observed(scene, camera=2)


def test_a_discharge_curve_gives_shares_and_rate(scene: gc.Scene, tmp_path: Path) -> None:
    path = tmp_path / "curves.csv"
    rows = ["series,time_s,discharged_percent"]
    rows += [f"a,{0.05 * i},{min(100.0, 12.0 * i)}" for i in range(12)]
    rows += ["b,0,0", "b,1,10"]
    path.write_text("\n".join(rows) + "\n")
    observed = gc.Recording.observed(path, scene, series="a")
    assert observed["discharged[0.1]"] == pytest.approx(24.0)
    assert observed["discharge_rate"] == pytest.approx(240.0)
    with pytest.raises(ValueError, match=r"\['a', 'b'\], got None"):
        DischargeCurve.open(path)
    cases = {
        "a,0,0;a,1,inf;a,2,20": "line 3 must be a finite time",
        "a,nan,0;a,1,50": "line 2 must be a finite time",
        "a,0,0;a,1,120": "line 3 must be .* from 0 to 100 %",
        "a,0,100;a,1,60;a,2,10": "line 3: what has run out cannot fall",
        "a,0,0;a,1,0.4;a,2,0.9": "ends at 0.9 %, must pass 5 %",
    }
    for text, match in cases.items():
        path.write_text("\n".join([rows[0], *text.split(";")]) + "\n")
        with pytest.raises(ValueError, match=match):
            DischargeCurve.open(path)
    # A balance swings: measured curves fall by a tenth of a percent.
    path.write_text("\n".join([rows[0], "a,0,-0.2", "a,1,50", "a,2,49.9", "a,3,100.3"]) + "\n")
    assert len(DischargeCurve.open(path).time) == 4
    # As a spreadsheet writes it: a mark before the text, and an empty line at its end.
    path.write_text(f"\ufeff{rows[0]}\r\na,0,0\r\na,1,50\r\n\r\n", encoding="utf-8")
    assert DischargeCurve.open(path).percent.tolist() == [0.0, 50.0]
    path.write_text("time,percent\n0,0\n")
    with pytest.raises(ValueError, match="the columns must be"):
        DischargeCurve.open(path)
    # With the mark that a spreadsheet writes before a table of UTF-8.
    path.write_text("\n".join([rows[0], "a,0,0", "a,1,50", "a,2,90"]) + "\n", "utf-8-sig")
    assert len(DischargeCurve.open(path).time) == 3
    # A table of statistics with other commas, and a map of heights.
    for text in ("statistic;value", ",".join(["0.0"] * 500)):
        path.write_text(f"{text}\n")
        with pytest.raises(ValueError, match="or statistic,value of a table, got") as told:
            DischargeCurve.open(path)
        assert len(str(told.value)) < len(str(path)) + 250


def test_what_stays_behind_does_not_slow_a_discharge(scene: gc.Scene, tmp_path: Path) -> None:
    path = tmp_path / "flat.csv"
    # 40 %/s for a second and a half; the rest lies on the flat bottom, however long one looks.
    for seconds in (1.6, 4.0, 40.0):
        times = np.arange(0.0, seconds, 0.01)
        rows = [f"a,{t:.2f},{min(60.0, 40.0 * t):.4f}" for t in times]
        path.write_text("\n".join(["series,time_s,discharged_percent", *rows]) + "\n")
        observed = gc.Recording.observed(path, scene)
        assert observed["discharge_rate"] == pytest.approx(40.0), seconds


def test_a_measured_rate_is_that_of_pours() -> None:
    times = np.linspace(0.0, 3.0, 301)
    # Not in one piece, as the columns of a file are.
    table = np.column_stack([times, np.minimum(100.0, 45.0 * times), times])
    curve = DischargeCurve(series="a", time=table[:, 0], percent=table[:, 1])
    rate = _native.discharge_rate(times, np.minimum(100.0, 45.0 * times))
    assert curve.rate() == rate == pytest.approx(45.0)
    assert np.isnan(DischargeCurve(series="a", time=times[:2], percent=times[:2]).rate())
    with pytest.raises(ValueError, match="one number for each of the 301 of time, got 2"):
        _native.discharge_rate(times, times[:2])


@pytest.mark.parametrize("kind", [DischargeCurve, NamedValues])
def test_what_is_no_table_is_refused_by_its_name(kind: Any, tmp_path: Path) -> None:
    path = tmp_path / "weighed.csv"
    # A field of more than the 131,072 letters that are read, and letters of another code.
    for data in (b"1" * 200_000, "statistic,value\ngr\u00f6\u00dfe,1\n".encode("latin-1")):
        path.write_bytes(data)
        with pytest.raises(ValueError, match=r"weighed\.csv") as told:
            kind.open(path).observed(gc.Scene.drop(0.02, count=4))
        assert "codec" not in str(told.value)


def test_numbers_measured_by_other_means_have_their_names(scene: gc.Scene, tmp_path: Path) -> None:
    table = tmp_path / "counted.csv"
    table.write_text("\ufeffstatistic, value\nspilled, 12\n\nradius[50],0.013\n", "utf-8")
    observed = gc.Recording.observed(table, scene)
    assert observed["spilled"] == 12.0 and observed["radius[50]"] == 0.013
    assert np.isnan(observed["discharge_rate"])
    printed = tmp_path / "pour.json"
    printed.write_text('{"scene": "mine", "observed": {"spilled": 3, "radius[50]": null}}')
    observed = gc.Recording.observed(printed, scene)
    assert observed["spilled"] == 3.0 and np.isnan(observed["radius[50]"])
    cases = {
        "spiled,3": "'spiled' is no statistic of the scene .is it spilled",
        "spilled,many": "line 2 must be a name and a number",
        "spilled,23_5": "line 2 must be a name and a number",
        "spilled,nan": "line 2 must be a finite number",
        "spilled,1;spilled,2": "line 3: spilled stands there twice",
        "": "has no statistic",
    }
    for text, match in cases.items():
        table.write_text("\n".join(["statistic,value", *text.split(";")]) + "\n")
        with pytest.raises(ValueError, match=match):
            gc.Recording.observed(table, scene)
    printed.write_text('{"scene": "mine"}')
    with pytest.raises(ValueError, match="observed must be there"):
        gc.Recording.observed(printed, scene)
    with pytest.raises(ValueError, match="a .json file takes nothing, not width"):
        gc.Recording.observed(printed, scene, width=0.1)


def test_a_drum_picture_gives_its_surface(scene: gc.Scene, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    pixels, width, slope = 200, 0.04, 0.6
    centre = (np.arange(pixels) + 0.5) * width / pixels - 0.5 * width
    x, z = np.meshgrid(centre, -centre)
    grains = z < 0.002 - slope * x
    grey = np.where(grains & (np.hypot(x, z) < 0.5 * width), 20, 250).astype(np.uint8)
    path = tmp_path / "drum.bmp"
    image.fromarray(grey).save(path)
    observed = gc.Recording.observed(path, scene, width=width)
    pixel = width / pixels
    for at in (-0.01, 0.0, 0.01):
        name = f"surface_z[{at:g}]"
        assert observed[name] == pytest.approx(0.002 - slope * at, abs=pixel)
    assert observed["surface_slope"] == pytest.approx(np.degrees(np.arctan(slope)), abs=0.5)
    assert np.isnan(observed["spilled"])
    with pytest.raises(ValueError, match="width"):
        gc.Recording.observed(path, scene)
    # As many bits as the file has: 16 are not cut off at 255.
    deep = tmp_path / "deep.png"
    image.fromarray(grey.astype(np.uint16) * 257).save(deep)
    assert gc.Recording.observed(deep, scene, width=width) == pytest.approx(observed, nan_ok=True)
    image.fromarray(grey.astype(np.float32)).save(tmp_path / "drum.tiff")
    with pytest.raises(ValueError, match="8 or 16 bits of grey"):
        DrumImage.open(tmp_path / "drum.tiff", width=width)
    # A picture whose sides are cut off is not filled by the drum.
    image.fromarray(grey[:, 10:-10]).save(deep)
    with pytest.raises(ValueError, match="must be square, .* got 180x200 pixels"):
        gc.Recording.observed(deep, scene, width=width)
    wall = "shape = { kind = 'cylinder', from = [0, -1, 0], to = [0, 1, 0], radius = 0.02 }"
    drum = gc.Scene.from_toml(
        f"{scene.to_toml()}\n[[walls]]\n{wall}\n".replace("0.02 }", "0.0201 }")
    )
    assert gc.Recording.observed(path, drum, width=width)["surface_slope"] > 0
    with pytest.raises(ValueError, match=r"the scene's drum, 0.0402 m, got 40 m"):
        gc.Recording.observed(path, drum, width=1e3 * width)
    image.fromarray(np.full((50, 50), 9, np.uint8)).save(path)
    with pytest.raises(ValueError, match="shows no grains"):
        DrumImage.open(path, width=width)
    with pytest.raises(ValueError, match="observes nothing"):
        RunOut(time=np.zeros(1), particles=np.zeros((1, 2)), liquid=np.zeros((1, 2))).observed(
            gc.Scene.drop(0.02)
        )


def test_what_surrounds_a_drum_in_its_picture_counts_for_nothing(scene: gc.Scene) -> None:
    pixels, width = 200, 0.04
    centre = (np.arange(pixels) + 0.5) * width / pixels - 0.5 * width
    x, z = np.meshgrid(centre, -centre)
    grains = np.where(z < 0.003 - 0.3 * x, 20.0, 250.0)
    surfaces = []
    for around in (250.0, 0.0):
        grey = np.where(np.hypot(x, z) < 0.5 * width, grains, around)
        surfaces.append(DrumImage(grey=grey, width=width).observed(scene))
    assert surfaces[0]["surface_slope"] == pytest.approx(np.degrees(np.arctan(0.3)), abs=0.5)
    assert surfaces[1] == pytest.approx(surfaces[0], nan_ok=True)


def test_measured_kinds_that_nobody_knows_are_refused(scene: gc.Scene, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\.bmp, \.png, \.txt, \.csv"):
        gc.Recording.observed(tmp_path / "x.mp4", scene)


def test_a_start_in_a_wall_is_refused(scene: gc.Scene) -> None:
    wall = (
        "[[walls]]\nshape = { kind = 'plane', point = [0.0, 0.0, 0.03], normal = [0.0, 0.0, 1.0] }"
    )
    bad = gc.Scene.from_toml(gc.Scene.drop(0.02, count=60).to_toml() + wall)
    with pytest.raises(ValueError, match=r"start in walls\.0"):
        gc.simulate(bad)
