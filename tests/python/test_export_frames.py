"""A pour over time as files for ParaView and Blender, and beds of scenes that no engine takes."""

import json
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.export import export_bed, export_frames

SCENE = gc.Scene.drop(0.02, count=20, preset="fast")
EXAMPLES = Path(__file__).parents[2] / "examples"


def vtk_array(text: str, name: str, columns: int, rows: int) -> np.ndarray:
    """Returns an array of a legacy VTK file, after the line that begins with `name`."""
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith(name):
            break
    found = [line for line in lines if not line.startswith("LOOKUP_TABLE")][:rows]
    return np.array([line.split() for line in found], float).reshape(rows, columns)


def test_paraview_gets_every_frame_with_its_time(tmp_path: Path) -> None:
    seen = gc.simulate(SCENE, seed=1, every=0.02).trajectory
    files = export_frames(seen, "vtk", tmp_path)
    assert [file.name for file in files[:2]] == ["frame-00000.vtk", "frame-00001.vtk"]
    series = json.loads((tmp_path / "frames.vtk.series").read_text())
    assert [entry["name"] for entry in series["files"]] == [file.name for file in files[:-1]]
    assert [entry["time"] for entry in series["files"]] == pytest.approx(seen.times, abs=1e-9)
    for frame in (0, len(seen) - 1):
        text = files[frame].read_text()
        assert vtk_array(text, "POINTS", 3, 20) == pytest.approx(seen.positions[frame], rel=1e-8)
        assert vtk_array(text, "SCALARS radius", 1, 20)[:, 0] == pytest.approx(seen.radii)
        assert vtk_array(text, "SCALARS number", 1, 20)[:, 0].tolist() == list(range(20))
        fast = vtk_array(text, "VECTORS velocity", 3, 20)
        assert fast == pytest.approx(seen.velocities[frame], rel=1e-8)


@pytest.mark.parametrize("kind", ["csv", "ply"])
def test_tables_of_frames_have_numbers_and_velocities(kind: str, tmp_path: Path) -> None:
    seen = gc.simulate(SCENE, seed=1, every=0.05).trajectory
    files = export_frames(seen, kind, tmp_path)
    lines = files[1].read_text().splitlines()
    names = ["number", "x", "y", "z", "radius", "vx", "vy", "vz"]
    if kind == "ply":
        assert [line.split()[2] for line in lines if line.startswith("property")] == names
        lines = lines[lines.index("end_header") + 1 :]
    else:
        assert lines.pop(0).split(",") == names
    table = np.array([line.replace(",", " ").split() for line in lines], float)
    expected = np.column_stack([np.arange(20), seen.positions[1], seen.radii, seen.velocities[1]])
    assert table == pytest.approx(expected, rel=1e-8)
    times = (tmp_path / "times.csv").read_text().splitlines()
    assert times[0] == "file,time" and len(times) == len(seen) + 1


def test_grains_that_have_left_are_in_no_frame(tmp_path: Path) -> None:
    text = gc.Scene.drop(0.1, count=30).to_toml() + "\n[outflow]\nbelow = 0.05\n"
    seen = gc.simulate(gc.Scene.from_toml(text), seed=1, every=0.02).trajectory
    files = export_frames(seen, "csv", tmp_path)
    counts = [len(file.read_text().splitlines()) - 1 for file in files[:-1]]
    assert counts[0] == 30 and counts[-1] == 0
    assert counts == np.isfinite(seen.positions[:, :, 0]).sum(axis=1).tolist()


def test_frames_of_a_longer_pour_do_not_stay_and_those_of_others_do(tmp_path: Path) -> None:
    for kind in ("vtk", "csv"):
        long, short = (gc.simulate(SCENE, seed=1, every=e).trajectory for e in (0.01, 0.05))
        (tmp_path / f"frame-own{'.vtk' if kind == 'vtk' else '.csv'}").write_text("mine\n")
        assert len(export_frames(long, kind, tmp_path)) > len(export_frames(short, kind, tmp_path))
        assert len(list(tmp_path.glob(f"frame-0*.{kind}"))) == len(short)
        assert (tmp_path / f"frame-own.{kind}").read_text() == "mine\n"
    (tmp_path / "frame-00001.vtk").write_text("mine\n")
    with pytest.raises(ValueError, match=r"frame-00001.vtk is left as it is"):
        export_frames(short, "vtk", tmp_path)


def test_the_word_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["export", "frames", "drop", "--set", "grains.count=20", "--to", "vtk"]
    assert main([*words, "--every", "0.1", "-o", str(tmp_path / "out"), "--json"]) == 0
    files = json.loads(capsys.readouterr().out)["files"]
    assert Path(files[-1]).name == "frames.vtk.series" and len(files) > 3
    assert main([*words, "--every", "0", "-o", str(tmp_path / "out")]) == 2
    assert "every must be at least a substep" in capsys.readouterr().err


def test_what_has_a_shape_is_no_point(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shape = '[grains]\nshape = { kind = "box", aspect = [1.0, 1.0, 1.0] }'
    scene = gc.Scene.from_toml(SCENE.to_toml().replace("[grains]", shape))
    with pytest.raises(ValueError, match="frames are written of round grains alone"):
        export_frames(gc.simulate(scene, every=0.1).trajectory, "vtk", tmp_path)
    (tmp_path / "boxes.toml").write_text(scene.to_toml())
    words = [str(tmp_path / "boxes.toml"), "--to", "vtk", "-o", str(tmp_path / "out")]
    assert main(["export", "frames", *words]) == 2
    assert "frames are written of round grains alone" in capsys.readouterr().err
    assert main(["export", "bed", *words[:3], "-o", str(tmp_path / "bed.vtk")]) == 2
    assert "Pour.vertices() has the bodies' corners" in capsys.readouterr().err
    with pytest.raises(ValueError, match="frames are written as one of vtk, ply, csv, got 'stl'"):
        export_frames(gc.simulate(SCENE, every=0.1).trajectory, "stl", tmp_path)


def test_grains_of_a_hopper_can_be_viewed_whatever_its_walls_do(tmp_path: Path) -> None:
    """A file of points had been refused for the gate that moves, which no engine is told."""
    scene = gc.Scene.load(EXAMPLES / "hopper_round.toml").with_({"grains.count": 50})
    positions, radii = scene.start(1)
    for kind in ("vtk", "ply", "csv"):
        path = export_bed(scene, positions, radii, kind, tmp_path / f"bed.{kind}")
        assert path.stat().st_size > 1000
    with pytest.raises(ValueError, match="motion 'lift' is not exported; only walls at rest are"):
        export_bed(scene, positions, radii, "mjcf", tmp_path / "bed.xml")
