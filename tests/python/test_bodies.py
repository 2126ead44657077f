"""Where the bodies of a pour are: turns, axes and corners; and how clumps are counted."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import granulcal as gc

HULL = np.array(
    [
        [0.2, -0.3, 1.9],
        [0.9, -0.8, 0.5],
        [1.7, 0.5, -0.4],
        [-0.9, -0.4, 0.1],
        [-0.5, 0.9, -0.3],
        [0.4, 0.6, 1.2],
        [1.1, 0.2, -0.6],
    ]
)
SHAPES = {
    "box": 'kind = "box", aspect = [1.0, 2.0, 0.5]',
    "cylinder": 'kind = "cylinder", aspect = 1.5',
    "superquadric": 'kind = "superquadric", aspect = [1.0, 1.3, 0.7], exponents = [2.5, 4.0]',
    "hull": f'kind = "hull", points = {json.dumps(HULL.tolist())}',
}
DIAMETER = 6e-3


def of_shape(kind: str) -> gc.Scene:
    """Returns a few grains of a shape that fall on the ground, apart from each other."""
    return gc.Scene.from_toml(
        f"""
name = "{kind}"
[material]
sliding_friction = 0.5
rolling_friction = 0.1
restitution = 0.2
[grains]
count = 9
diameter = {DIAMETER}
density = 1300.0
shape = {{ {SHAPES[kind]} }}
[start]
kind = "grid"
counts = [3, 3, 1]
spacing = 0.03
jitter = 1e-4
base = 0.015
[end]
kinetic_energy = 1e-9
horizon = 2.0
"""
    )


@pytest.mark.parametrize("kind", SHAPES)
def test_bodies_at_rest_stand_on_the_ground_with_their_lowest_corner(kind: str) -> None:
    pour = gc.simulate(of_shape(kind), seed=1)
    vertices = pour.vertices()
    body = pour.scene.body_vertices()
    assert vertices.shape == (9, len(body), 3) and len(body) >= 7
    lowest = vertices[:, :, 2].min(axis=1)
    assert np.all(lowest >= -1e-5) and np.all(lowest < 1e-4), lowest
    turns = Rotation.from_quat(pour.orientations)
    there = pour.positions[4] + turns[4].apply(body)
    assert np.allclose(there, vertices[4], atol=1e-12)


@pytest.mark.parametrize("kind", SHAPES)
def test_bodies_begin_where_others_ended(kind: str) -> None:
    scene = of_shape(kind)
    pour = gc.simulate(scene, seed=1)
    start = {"positions": pour.positions, "orientations": pour.orientations}
    lists = "".join(f"{key} = {json.dumps(rows.tolist())}\n" for key, rows in start.items())
    head, _, rest = scene.to_toml().partition("[start]\n")
    end = rest[rest.index("\n[") :]
    lying = gc.Scene.from_toml(f'{head}[start]\nkind = "poses"\n{lists}{end}')
    again = gc.simulate(lying, seed=5)
    assert again.status == "at_rest"
    # As they lay, to a hundredth of their size: whatever the seed.
    assert np.allclose(again.vertices(), pour.vertices(), atol=0.01 * DIAMETER)
    with pytest.raises(ValueError, match=r"start\.orientations has 8 entries, expected .* 9"):
        short = json.dumps(pour.orientations[1:].tolist())
        gc.Scene.from_toml(lying.to_toml().replace(_orientations(lying), short))


def _orientations(scene: gc.Scene) -> str:
    rest = scene.to_toml().partition("orientations = ")[2]
    return rest[: rest.index("\n[")]


def test_the_axes_are_the_documented_ones() -> None:
    box = of_shape("box").body_vertices()
    assert np.allclose(np.ptp(box, axis=0), [DIAMETER, 2 * DIAMETER, 0.5 * DIAMETER])
    can = of_shape("cylinder").body_vertices(on_rim=12)
    assert can.shape == (24, 3)
    assert np.allclose(abs(can[:, 1]), 0.75 * DIAMETER)
    assert np.allclose(np.hypot(can[:, 0], can[:, 2]), 0.5 * DIAMETER)
    for kind in ("box", "cylinder"):
        centre, axes = of_shape(kind).body_frame()
        assert not centre.any() and np.array_equal(axes, np.eye(3))


def test_a_hulls_own_points_are_found_in_its_axes() -> None:
    scene = of_shape("hull")
    centre, axes = scene.body_frame()
    assert np.allclose(axes.T @ axes, np.eye(3)) and np.linalg.det(axes) == pytest.approx(1.0)
    stated = HULL * DIAMETER / np.ptp(HULL, axis=0).max()
    body = (stated - centre) @ axes
    for corner in scene.body_vertices():
        assert np.linalg.norm(body - corner, axis=1).min() < 1e-12
    # A superquadric's widths are those along the axes that carry its own.
    scene = of_shape("superquadric")
    centre, axes = scene.body_frame()
    wide = np.ptp(scene.body_vertices() @ axes.T + centre, axis=0)
    assert wide == pytest.approx(np.array([1.0, 1.3, 0.7]) * DIAMETER, rel=0.02)


def test_round_grains_have_no_axes() -> None:
    pour = gc.simulate(gc.Scene.drop(0.02, count=5), seed=1)
    assert pour.vertices().shape == (0, 0, 3) and pour.scene.body_vertices().shape == (0, 3)
    with pytest.raises(ValueError, match=r"drop: the grains have no grains\.shape"):
        pour.scene.body_frame()
    with pytest.raises(ValueError, match="on_rim must be at least 3, got 2"):
        pour.vertices(2)
    assert repr(pour).startswith("Pour(5 grains, ")


def test_clumps_are_counted_by_spheres_and_by_grains() -> None:
    """A pour of 7 clumps had called itself one of 21 grains."""
    clump = {"effects.clump.spheres": 3, "effects.clump.aspect": 2.0}
    pour = gc.simulate(gc.Scene.drop(0.02, count=7).with_(clump), seed=1)
    assert pour.positions.shape == (21, 3)
    assert repr(pour).startswith("Pour(21 spheres of 7 grains, ")
    assert "21 spheres of 7 grains" in pour._repr_html_()
