"""Walls in the words of engines: which way round they are stated, and what an engine has not."""

import json

import pytest

import granulcal as gc
from granulcal.export import ENGINES
from granulcal.export.setup import Setup

UP = {"from": [0, 0, 0.2], "to": [0, 0, 0.3]}
DOWN = {"from": [0, 0, 0.3], "to": [0, 0, 0.2]}


@pytest.fixture(scope="module")
def scene() -> gc.Scene:
    return gc.Scene.drop(0.05, count=10, preset="fast")


def text(scene: gc.Scene, engine: str, **shape: object) -> str:
    """Returns the file of a pour with one wall."""
    words = ", ".join(f"{key} = {json.dumps(value)}" for key, value in shape.items())
    walled = gc.Scene.from_toml(f"{scene.to_toml()}\n[[walls]]\nshape = {{ {words} }}\n")
    if engine == "mujoco":
        return ENGINES[engine].mjcf(Setup.of(walled))
    return ENGINES[engine].scene(Setup.of(walled))["in.pour"]


@pytest.mark.parametrize(("up", "down"), [("none", "none"), ("from", "to"), ("both", "both")])
def test_a_round_wall_may_be_stated_from_its_upper_end(scene: gc.Scene, up: str, down: str) -> None:
    cone = {"kind": "cone", "closed": up, "radius_from": 0.05, "radius_to": 0.06}
    turned = {"kind": "cone", "closed": down, "radius_from": 0.06, "radius_to": 0.05}
    assert text(scene, "lammps", **cone, **UP) == text(scene, "lammps", **turned, **DOWN)
    tube = {"kind": "cylinder", "radius": 0.05}
    lid = text(scene, "lammps", **tube, closed=up, **UP)
    assert lid == text(scene, "lammps", **tube, closed=down, **DOWN)
    # A region's faces: 1 is the low one.
    faces = {"none": "0.2 0.3 open 1 open 2\n", "from": "0.2 0.3 open 2\n", "both": "0.2 0.3\n"}
    assert faces[up] in lid


def test_a_wall_that_an_engine_has_not_is_named_by_its_path(scene: gc.Scene) -> None:
    disc = {"kind": "disc", "centre": [0, 0, 0.2], "normal": [0, 0, 1], "radius": 0.05}
    tube = {"kind": "cylinder", "radius": 0.05}
    aside = {"from": [0, 0, 0.2], "to": [0.1, 0, 0.3]}
    for engine in ("lammps", "mujoco"):
        with pytest.raises(ValueError, match=r"walls\.0: .*'disc'.* only plane, box, cylinder"):
            text(scene, engine, **disc)
    with pytest.raises(ValueError, match=r"walls\.0: .* `closed` is 'to' has no MJCF"):
        text(scene, "mujoco", **tube, **UP, closed="to")
    with pytest.raises(ValueError, match=r"walls\.0: LAMMPS has round walls along x, y or z"):
        text(scene, "lammps", **tube, **aside)


def test_lammps_keeps_what_is_said_of_lost_grains(scene: gc.Scene) -> None:
    lines = text(scene, "lammps", kind="plane", point=[0, 0, -1], normal=[0, 0, 1]).splitlines()
    words = [line.split()[0] for line in lines if line.startswith("thermo_")]
    # A style that comes after it takes it back, with a warning at every run.
    assert words == ["thermo_style", "thermo_modify"]
