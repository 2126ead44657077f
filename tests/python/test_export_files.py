"""What stands in exported files, and which files are replaced."""

import json
import math
import re
import xml.etree.ElementTree as ET
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import granulcal as gc
from granulcal.export import (
    ENGINES,
    export_bed,
    export_material,
    export_posterior,
    export_scene,
)
from granulcal.export.bed import FORMATS
from granulcal.export.engines import SofterWarning
from granulcal.export.head import commented
from granulcal.export.law import nominal_restitution
from granulcal.export.mark import MARK, plain
from granulcal.export.setup import Setup

WITHOUT_USD = [name for name in ENGINES if name != "isaac"]
EVIL = 'x"""\nimport os\n-->&<b>\\ ---- $y'


@pytest.fixture(scope="module")
def scene() -> gc.Scene:
    return gc.Scene.funnel(0.06, count=20, preset="fast")


@pytest.fixture(scope="module")
def mixed(scene: gc.Scene) -> gc.Scene:
    return scene.with_({"effects.polydispersity.cv": 0.2})


def test_a_name_is_text_alone() -> None:
    assert plain("Couscous 2.5 mm, a-b+c_d é") == "Couscous 2.5 mm_ a-b+c_d é"
    assert plain("a ---- b") == "a - b" and plain("\n") == "_" and plain("") == "scene"
    assert len(plain("x" * 500)) == 80
    assert not set(plain(EVIL)) & set("\"'\n\\<>&$`")


@pytest.mark.parametrize("engine", WITHOUT_USD)
def test_a_scenes_name_is_neither_code_nor_markup(
    engine: str, scene: gc.Scene, tmp_path: Path
) -> None:
    named = scene.with_(name=EVIL)
    files = export_scene(named, engine, tmp_path)
    files.append(export_material(named, engine, tmp_path))
    for path in files:
        text = path.read_text()
        assert MARK in text[:1024], path.name
        assert "import os\n-->" not in text and "&<b>" not in text
        if path.suffix in (".xml", ".sdf"):
            ET.fromstring(text)
        elif path.suffix == ".py":
            compile(text, path.name, "exec")
        elif path.name == "pour.data":
            # What follows the first line is counted in lines.
            assert text.splitlines()[2] == "20 atoms"
    for kind in ("lammps-data", "mjcf", "sdf", "urdf"):
        bed = export_bed(named, named.start(0)[0], None, kind, tmp_path / f"bed{FORMATS[kind]}")
        if kind != "lammps-data":
            ET.fromstring(bed.read_text())
        bed.unlink()


def test_dashes_end_no_comment() -> None:
    ET.fromstring(commented(["a--b ---- c"], "<a/>", ".xml"))


@pytest.mark.parametrize("kind", FORMATS)
def test_a_bed_bears_the_mark_where_its_format_has_comments(
    kind: str, scene: gc.Scene, tmp_path: Path
) -> None:
    path = tmp_path / f"bed{FORMATS[kind]}"
    for _ in range(2):
        assert (MARK in export_bed(scene, scene.start(0)[0], None, kind, path).read_text()) == (
            kind != "csv"
        )
    if kind != "csv":
        path.write_text("my own\n")
        with pytest.raises(ValueError, match="granulcal did not export it"):
            export_bed(scene, scene.start(0)[0], None, kind, path)
        assert path.read_text() == "my own\n"


@pytest.mark.parametrize("name", ["README.txt", "pour.py", "pour.json"])
def test_a_users_own_file_is_not_replaced(name: str, scene: gc.Scene, tmp_path: Path) -> None:
    own = '{"mine": 1}\n' if name == "pour.json" else "mine = 1 # notes\n"
    (tmp_path / name).write_text(own)
    with pytest.raises(ValueError, match=rf"{name} is left as it is: granulcal did not export it"):
        export_scene(scene, "yade", tmp_path)
    # And nothing is written beside it.
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == own
    (tmp_path / name).unlink()
    for _ in range(2):
        export_scene(scene, "yade", tmp_path)


def test_a_users_own_material_is_not_replaced(scene: gc.Scene, tmp_path: Path) -> None:
    path = tmp_path / "my.in"
    path.write_text("units si\n")
    with pytest.raises(ValueError, match="my.in is left as it is"):
        export_material(scene, "lammps", path)
    assert path.read_text() == "units si\n"
    path.write_text("")
    for _ in range(2):
        export_material(scene, "lammps", path)


def test_clumps_are_refused_by_name(scene: gc.Scene, tmp_path: Path) -> None:
    """They had become twice as many loose balls."""
    clumps = scene.with_({"effects.clump.aspect": 1.4})
    for write in (
        lambda: export_scene(clumps, "lammps", tmp_path),
        lambda: export_material(clumps, "lammps", tmp_path),
        lambda: export_bed(clumps, clumps.start(0)[0], None, "csv", tmp_path / "bed.csv"),
    ):
        with pytest.raises(ValueError, match="`effects.clump` has no counterpart"):
            write()
    assert not list(tmp_path.iterdir())


def test_a_funnel_that_is_not_in_its_place_is_refused(scene: gc.Scene, tmp_path: Path) -> None:
    """The grains' start had followed it, and its walls had not."""
    for name, value in (("x", 0.005), ("lean_y", 0.1)):
        moved = scene.with_({f"effects.funnel.{name}": value})
        with pytest.raises(ValueError, match=rf"`effects.funnel` has {name} = {value:g}"):
            export_scene(moved, "lammps", tmp_path)
    rubbed = scene.with_({"effects.funnel.sliding_friction": 0.5})
    readme = export_scene(rubbed, "lammps", tmp_path)[-1].read_text()
    assert "Left out: effects.funnel" in readme


@pytest.mark.parametrize("engine", WITHOUT_USD)
def test_grains_that_differ_in_size_are_told(
    engine: str, scene: gc.Scene, mixed: gc.Scene, tmp_path: Path
) -> None:
    radii = mixed.start(0)[1]
    told = f"grains of {1e3 * radii.min():.6g} to {1e3 * radii.max():.6g} mm in radius: "
    told += ENGINES[engine].UNEQUAL
    assert "of the smallest" in told
    assert told in export_scene(mixed, engine, tmp_path / "mixed")[-1].read_text()
    assert told in export_material(mixed, engine, tmp_path / f"mixed{engine}").read_text()
    plain_readme = export_scene(scene, engine, tmp_path / "plain")[-1].read_text()
    assert "mm in radius" not in plain_readme


def test_a_mujoco_grain_has_the_lengths_of_its_own_radius(mixed: gc.Scene) -> None:
    setup = Setup.of(mixed)
    bodies = list(ET.fromstring(ENGINES["mujoco"].mjcf(setup)).iter("body"))
    found = [[float(w) for w in str(b[1].get("friction")).split()] for b in bodies]
    law, lever = setup.grains, 0.5 * setup.radii
    assert np.allclose(np.array(found)[:, 2], law.rolling_friction * lever, rtol=1e-5)
    assert np.allclose(np.array(found)[:, 1], law.torsional_friction * lever, rtol=1e-5)


def test_chrono_bounces_and_touches_at_the_scale_of_grains(scene: gc.Scene, tmp_path: Path) -> None:
    text = export_scene(scene, "chrono", tmp_path)[0].read_text()
    skins = (
        "chrono.ChCollisionModel.SetDefaultSuggestedEnvelope(0.0002)",
        "chrono.ChCollisionModel.SetDefaultSuggestedMargin(0.0001)",
    )
    assert text.index("ChSystemNSC()") < text.index("system.SetMinBounceSpeed(0.01)")
    first = text.index("ChBodyEasyBox")
    assert all(text.index(f"\n{line}\n") < first for line in skins)
    head = export_material(scene, "chrono", tmp_path / "material.py").read_text()
    assert all(line in head for line in (*skins, "system.SetMinBounceSpeed(0.01)"))


def test_a_posterior_that_fails_leaves_the_earlier_one_whole(
    scene: gc.Scene, tmp_path: Path
) -> None:
    name = "material.sliding_friction"

    def write(to: str, draws: list[float]) -> None:
        export_posterior([name], [0.3], np.array(draws)[:, None], scene, to, tmp_path)

    write("mujoco", [0.2, 0.4, 0.5])
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(ValueError, match="sliding_friction"):
        write("mujoco", [0.2, -1.0])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    # Whatever the table has lost: what bears the mark is removed.
    (tmp_path / "draws.json").unlink()
    (tmp_path / "draw-007.py").write_text("mine = 1\n")
    write("lammps", [0.2])
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["draw-000.in", "draw-007.py", "draws.json", "mode.in"]
    assert "draw 0 of a posterior: material.sliding_friction" in (
        (tmp_path / "draw-000.in").read_text()
    )
    (tmp_path / "draw-001.in").write_text("mine = 1\n")
    with pytest.raises(ValueError, match="draw-001.in is left as it is"):
        write("lammps", [0.2, 0.3])
    (tmp_path / "draw-001.in").unlink()
    (tmp_path / "draws.json").write_text('[{"file": "notes.txt"}]')
    with pytest.raises(ValueError, match="lists 'notes.txt', no draw"):
        write("lammps", [0.2])


def test_draws_are_listed_before_they_are_written(
    scene: gc.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[str] = []
    monkeypatch.setattr(
        "granulcal.export.posterior.write_beside", lambda path, _: written.append(path.name)
    )
    export_posterior(
        ["material.sliding_friction"], [0.3], [[0.2], [0.4]], scene, "lammps", tmp_path
    )
    assert written[0] == "draws.json" and len(written) == 4


@pytest.mark.parametrize("young", [math.nan, math.inf, 0.0, -1.0, 9e3, 2e12])
def test_no_grain_has_this_youngs_modulus(young: float, scene: gc.Scene, tmp_path: Path) -> None:
    for write in (export_material, export_scene):
        with pytest.raises(ValueError, match=r"young must be from 10000 to 1e\+12 Pa, got"):
            write(scene, "lammps", tmp_path, young=young)
    assert not list(tmp_path.iterdir())


def test_rigid_grains_have_no_youngs_modulus(scene: gc.Scene, tmp_path: Path) -> None:
    for engine in ("mujoco", "chrono", "newton", "gazebo", "isaac"):
        with pytest.raises(ValueError, match=f"young must be left out for {engine}"):
            export_material(scene, engine, tmp_path, young=1e7)
    with pytest.warns(SofterWarning, match=r"no grains softer than 5e\+06 Pa"):
        text = export_material(scene, "liggghts", tmp_path, young=1e6).read_text()
    assert "youngsModulus peratomtype 5e+06" in text


def test_a_bed_of_grains_without_a_place_is_refused(scene: gc.Scene, tmp_path: Path) -> None:
    centres, _ = scene.start(0)
    lost = centres.copy()
    lost[3, 1] = np.nan
    with pytest.raises(ValueError, match="positions must be finite .*; those of 1 grains are not"):
        export_bed(scene, lost, None, "vtk", tmp_path / "bed.vtk")
    with pytest.raises(ValueError, match="radii must be positive"):
        export_bed(scene, centres, np.zeros(20), "vtk", tmp_path / "bed.vtk")


def test_the_box_of_lammps_holds_every_grain(scene: gc.Scene, tmp_path: Path) -> None:
    centres = np.array([[7.123456789, -9.2, -0.5], [0.0, 0.0, 12.0]])
    text = export_bed(scene, centres, None, "lammps-data", tmp_path / "bed.data").read_text()
    radius = Setup.of(scene).smallest
    for axis, (letter, row) in enumerate(zip("xyz", text.splitlines()[5:8], strict=True)):
        low, high = map(float, row.split()[:2])
        assert f"{letter}lo {letter}hi" in row
        assert low <= (centres[:, axis] - radius).min() + 1e-9
        assert high >= (centres[:, axis] + radius).max() - 1e-8


@pytest.mark.parametrize("engine", WITHOUT_USD)
def test_a_scene_without_gravity_is_written(engine: str, scene: gc.Scene, tmp_path: Path) -> None:
    text = re.sub(r"gravity = .*", "gravity = [0.0, 0.0, 0.0]", scene.to_toml())
    files = export_scene(gc.Scene.from_toml(text), engine, tmp_path)
    assert not any("fix           gravity" in path.read_text() for path in files)


def test_usd_states_its_units(scene: gc.Scene) -> None:
    text = ENGINES["isaac"].material(Setup.of(scene))
    layer = text[: text.index("def Material")]
    for line in ("metersPerUnit = 1", "kilogramsPerUnit = 1", 'upAxis = "Z"'):
        assert f"    {line}\n" in layer


def test_physx_is_told_steps_and_bounces_that_suit_grains(scene: gc.Scene, tmp_path: Path) -> None:
    """At 60 steps a second, its own, grains of 4 mm fall 25 mm a step; 0.2 m/s did not bounce."""
    told = {"physxScene:bounceThreshold": "0.01", "physxScene:timeStepsPerSecond": "2000"}
    notes = " ".join(ENGINES["isaac"].NOTES)
    assert all(f"{name} = {value}" in notes for name, value in told.items())
    pytest.importorskip("pxr", reason="usd-core is not installed")
    export_scene(scene, "isaac", tmp_path)
    physics = (tmp_path / "pour.usda").read_text().split('def PhysicsScene "physics"')[1]
    physics = physics[: physics.index("}")]
    assert '"PhysxSceneAPI"' in physics
    assert all(f"{name} = {value}\n" in physics for name, value in told.items())


def test_gazebos_walls_are_told() -> None:
    told = " ".join(ENGINES["gazebo"].NOTES)
    assert "torsional friction at walls is half of ours" in told and "mu and bounce" in told


def test_lammps_restitution_at_critical_damping_is_a_number(scene: gc.Scene) -> None:
    assert nominal_restitution(1.0) == nominal_restitution(1 - 1e-12) == 1e-100
    at = scene.with_({"material.restitution": math.exp(-2)})
    nominal = float(ENGINES["lammps"].material(Setup.of(at)).split("hertz/material ")[1].split()[1])
    assert nominal >= 1e-100


def test_a_block_of_lammps_says_what_it_needs(scene: gc.Scene) -> None:
    first = ENGINES["lammps"].material(Setup.of(scene)).splitlines()[0]
    for word in ("units si", "atom_style sphere", "newton off", "comm_modify vel yes"):
        assert word in first


def test_a_writer_that_is_missing_leaves_no_folder(
    scene: gc.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(*_: object) -> dict[str, str]:
        raise ModuleNotFoundError("No module named 'pxr'", name="pxr")

    module = SimpleNamespace(ENGINE="isaac", scene=missing)
    monkeypatch.setitem(ENGINES, "isaac", module)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModuleNotFoundError):
        export_scene(scene, "isaac", tmp_path / "pour")
    assert not (tmp_path / "pour").exists()


def test_a_head_says_where_numbers_are_from(scene: gc.Scene, tmp_path: Path) -> None:
    readme = export_scene(scene, "yade", tmp_path, source=["of a posterior"])[-1].read_text()
    assert "\nof a posterior\n" in readme
    assert json.loads((tmp_path / "pour.json").read_text())["file"].endswith("for yade")


def test_what_a_prior_fixed_is_part_of_every_file(scene: gc.Scene, tmp_path: Path) -> None:
    name, fixed = "material.sliding_friction", {"material.rolling_friction": 0.77}
    files = export_posterior([name], [0.3], [[0.2]], scene, "lammps", tmp_path, fixed=fixed)
    for file, value in zip(files, (0.3, 0.2), strict=False):
        at = scene.with_({name: value, **fixed})
        told = file.read_text()
        assert ENGINES["lammps"].material(Setup.of(at)) in told
        assert "fixed by its prior: material.rolling_friction" in told
    with pytest.raises(ValueError, match="sliding_friction must be a parameter or fixed, got both"):
        export_posterior([name], [0.3], [], scene, "lammps", tmp_path, fixed={name: 0.4})


@pytest.mark.parametrize(
    ("mode", "draws", "told"),
    [
        ([0.3, 0.4], np.full((2, 3), 0.5), r"draws must have shape \(n, 2\), .*; got \(2, 3\)"),
        ([0.3, 0.4], [0.3, 0.4], r"draws must have shape \(n, 2\), .*; got \(2,\)"),
        ([0.3, 0.4], np.zeros((0, 3)), r"draws must have shape \(n, 2\), .*; got \(0, 3\)"),
        ([[0.3, 0.4]], [], r"mode must have shape \(2,\), .*restitution; got \(1, 2\)"),
        ([0.3], [], r"mode must have shape \(2,\), .*restitution; got \(1,\)"),
    ],
)
def test_draws_of_another_shape_are_refused(
    mode: object, draws: object, told: str, scene: gc.Scene, tmp_path: Path
) -> None:
    names = ["material.sliding_friction", "material.restitution"]
    with pytest.raises(ValueError, match=told):
        export_posterior(names, mode, draws, scene, "lammps", tmp_path / "out")  # pyright: ignore[reportArgumentType]
    assert not (tmp_path / "out").exists()
    # An empty list is no draws.
    assert len(export_posterior(names, [0.3, 0.4], [], scene, "lammps", tmp_path)) == 1
