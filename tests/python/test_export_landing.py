"""How deep elastic grains go where they land, and how far the ground of exported pours reaches."""

import json
import math
import re
import warnings
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.export import export_material, export_scene
from granulcal.export.landing import DEEP, DeepContactWarning, Landing
from granulcal.export.law import POISSON
from granulcal.export.setup import Setup

ELASTIC = ("lammps", "liggghts", "yade")


def gravel(height: float) -> gc.Scene:
    """Returns a few stones of 20 mm whose highest falls so far [m]."""
    text = gc.Scene.drop(0.1, count=4).to_toml()
    places = [[0.0, 0.0, height + 0.01], [0.1, 0.0, 0.05], [-0.1, 0.0, 0.05], [0.0, 0.1, 0.05]]
    start = f'[start]\nkind = "positions"\npositions = {json.dumps(places)}\n'
    text = re.sub(r"\[start\][^\[]*", start, text, count=1)
    text = text.replace("diameter = 0.004", "diameter = 0.02").replace("1300.0", "2600.0")
    return gc.Scene.from_toml(text)


def deepest(setup: Setup, speed: float, young: float) -> float:
    """Returns the largest overlap of a Hertz impact on the ground, by small steps [radii]."""
    r = setup.smallest
    mass = setup.density * 4 / 3 * math.pi * r**3
    stiffness = 4 / 3 * young / (2 * (1 - POISSON**2)) * math.sqrt(r)
    depth, dt = 0.0, 1e-7
    while speed > 0:
        speed -= dt * stiffness / mass * depth**1.5
        depth += dt * speed
    return depth / r


@pytest.mark.parametrize("height", [0.3, 1.0, 5.0])
def test_the_overlap_is_that_of_an_impact(height: float) -> None:
    setup = Setup.of(gravel(height))
    young = setup.stiffness().young
    landing = Landing.of(setup, young)
    assert landing.speed == pytest.approx(math.sqrt(2 * 9.81 * height), rel=1e-3)
    assert landing.overlap == pytest.approx(deepest(setup, landing.speed, young), rel=1e-2)
    # What is advised is enough, and hardly more.
    assert DEEP * 0.96 < Landing.of(setup, landing.enough).overlap <= DEEP
    small = replace(setup, radii=setup.radii / 4, centres=setup.centres - [0, 0, 0.0075])
    assert Landing.of(small, young).overlap == pytest.approx(landing.overlap)


def test_grains_that_are_too_soft_for_their_fall_are_told(tmp_path: Path) -> None:
    """20 mm gravel had gone .33 of a radius into the ground after 1 m, without a word."""
    for engine in ELASTIC:
        with pytest.warns(DeepContactWarning, match=r"4\.43 m/s and go 0\.\d+ of a radius") as told:
            files = export_scene(gravel(1.0), engine, tmp_path / engine)
        assert told[0].filename == __file__
        head = next(file for file in files if file.name == "README.txt").read_text()
        assert str(told[0].message) in head
        with pytest.warns(DeepContactWarning):
            assert "(Hertz)" in export_material(gravel(1.0), engine, tmp_path).read_text()
        young = float(re.findall(r"\(--young\) of (\S+) Pa", head)[0])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            files = export_scene(gravel(1.0), engine, tmp_path / engine, young=young)
        head = next(file for file in files if file.name == "README.txt").read_text()
        assert "(Hertz)" in head and "--young" not in head


@pytest.mark.filterwarnings("default::granulcal.export.landing.DeepContactWarning")
def test_the_command_warns_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.toml").write_text(gravel(5.0).to_toml())
    words = ["export", "scene", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "out"), "--to"]
    assert main([*words, "yade"]) == 0
    assert "0.63 of a radius" in capsys.readouterr().err
    assert main([*words, "mujoco"]) == 0
    assert capsys.readouterr().err == ""


def test_nothing_falls_where_there_is_no_gravity() -> None:
    still = replace(Setup.of(gravel(1.0)), gravity=(0.0, 0.0, 0.0))
    landing = Landing.of(still, 3e6)
    assert landing.overlap == landing.speed == landing.enough == 0.0
    assert "--young" not in landing.told()


def test_the_ground_reaches_as_far_as_grains_roll(tmp_path: Path) -> None:
    """Chrono's had ended 1 m from the axis."""
    scene = gravel(1.0).with_({"material.rolling_friction": 0.0})
    width = 2 * Setup.of(scene).half_width
    assert width > 4
    export_scene(scene, "chrono", tmp_path)
    box = re.findall(
        r"floor = chrono.ChBodyEasyBox\((.*?), (.*?), 0\.1,", (tmp_path / "pour.py").read_text()
    )
    assert np.allclose(np.array(box, float), width)
    export_scene(scene, "gazebo", tmp_path / "gazebo")
    plane = ET.parse(tmp_path / "gazebo/pour.sdf").find(".//plane/size")
    assert plane is not None and plane.text is not None
    assert np.allclose([float(side) for side in plane.text.split()], width)
