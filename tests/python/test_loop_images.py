"""Effects of the image: closed forms of the operators, and what an archive makes of them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.image_faults import (
    KINDS,
    Frame,
    blurred,
    flying,
    lost,
    require_image,
)
from granulcal.loop.effects.library import FUNNEL, LIBRARY, by_name
from granulcal.loop.pours.archive import Archive, ArchivePlan
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.measures import Measures
from granulcal.loop.task import FIT, Condition, Task

SCENE = """
name = "small"
[grains]
count = 90
diameter = 4e-3
density = 1300.0
[start]
kind = "grid"
counts = [5, 5, 4]
spacing = 6e-3
jitter = 5e-4
base = 0.04
[end]
horizon = 2.0
[camera]
projection = "PROJECTION"
height = 0.3
field_width = 0.3
pixels = 300
downsample = 1
height_threshold = 1e-3
"""
PRIOR = """
[[parameter]]
path = "material.sliding_friction"
distribution = "uniform"
low = 0.3
high = 0.8
"""
NAMES = [effect.name for effect in FUNNEL if effect.image]


def scene(projection: str = "pinhole") -> gc.Scene:
    return gc.Scene.from_toml(SCENE.replace("PROJECTION", projection))


@pytest.fixture(scope="module")
def pour() -> gc.Pour:
    return gc.simulate(scene(), seed=4)


@pytest.mark.parametrize("projection", ["pinhole", "orthographic"])
def test_the_frame_has_the_points_of_the_image(projection: str) -> None:
    seen = gc.simulate(scene(projection), seed=4)
    np.testing.assert_allclose(Frame.of(seen).points(), seen.points(), rtol=0, atol=1e-9)


def test_a_frame_and_a_recording_have_the_same_diameter_of_a_grain() -> None:
    unequal = scene("pinhole").with_({"effects.polydispersity.cv": 0.5})
    seen = gc.simulate(unequal, seed=4)
    # The mean diameter of such grains is a fifth less.
    assert 2 * seen.radii.mean() < 0.9 * unequal.get("grains.diameter")
    frame = Frame.of(seen)
    assert frame.diameter == unequal.get("grains.diameter")
    expected = gc.diagnostic_statistics(
        seen.points(),
        grain_diameter=unequal.get("grains.diameter"),
        spacing=frame.spacing,
        pour_axis=(0.0, 0.0),
    )
    np.testing.assert_allclose(seen.diagnostic_statistics(), expected, rtol=1e-9, atol=1e-12)


def test_an_offset_moves_heights_by_itself_and_nothing_else(pour: gc.Pour) -> None:
    measures = Measures.of(pour.scene)
    plain = dict(zip(measures.names, measures.of_pour(pour), strict=True))
    for offset in (7e-4, -5e-4):
        found = dict(zip(measures.names, measures.of_pour(pour, {"offset": offset}), strict=True))
        assert found["mean_z"] - plain["mean_z"] == pytest.approx(offset, rel=1e-9)
        assert found["max_z"] - plain["max_z"] == pytest.approx(offset, rel=1e-9)
        for name in ("mean_r", "sd_z", "isolated_grains"):
            assert found[name] == pytest.approx(plain[name], rel=1e-9)


def test_what_an_offset_takes_below_the_threshold_is_not_seen() -> None:
    # The flank of a blurred grain: a reading knows the lifted heights and one threshold.
    flank = np.array([[0.0, 0.8e-3, 1.2e-3, 1.6e-3, 2.4e-3]])
    frame = Frame(flank, spacing=1e-3, eye=np.inf, threshold=1e-3, diameter=4e-3)

    def seen(offset: float) -> list[float]:
        return frame.with_({"offset": offset}, seed=0).points()[:, 2].tolist()

    assert seen(-5e-4) == pytest.approx([1.1e-3, 1.9e-3])
    # What was ground is ground, however high it would be.
    assert seen(5e-4) == pytest.approx([1.7e-3, 2.1e-3, 2.9e-3])


def test_a_blurred_step_is_an_error_function() -> None:
    sigma, count = 2.5, 81
    z = np.zeros((7, count))
    z[:, count // 2 + 1 :] = 1.0
    u = np.arange(count) - count // 2 - 0.5
    expected = [0.5 * (1 + math.erf(x / (sigma * math.sqrt(2)))) for x in u]
    found = blurred(z, sigma)
    # A sum over pixels for an integral: the error is h^2 / 24 of the kernel's slope at most.
    inner = slice(12, -12)
    largest = 1 / (24 * sigma**2 * math.sqrt(2 * math.pi * math.e))
    np.testing.assert_allclose(found[3, inner], expected[inner], rtol=0, atol=1.1 * largest)
    # Along the other axis nothing changes, and a constant stays one around missing pixels.
    np.testing.assert_allclose(found, np.tile(found[3], (7, 1)), atol=1e-12)
    holes = np.full((9, 9), 0.3)
    holes[4, 2:5] = np.nan
    np.testing.assert_allclose(blurred(holes, 1.0), holes, atol=1e-12)


def test_flying_pixels_lie_between_both_sides_of_an_edge() -> None:
    z = np.zeros((200, 40))
    z[:, 20:] = 4e-3
    z[5, 20] = np.nan
    found = flying(z, 0.4, 1e-3, np.random.default_rng(1))
    changed = (found != z) & np.isfinite(z)
    # The two columns at the edge, a share of 0.4 of them, and nothing elsewhere.
    assert not changed[:, :19].any() and not changed[:, 21:].any()
    assert np.isnan(found[5, 20])
    assert changed[:, 19:21].sum() == pytest.approx(0.4 * 400, abs=4 * math.sqrt(400 * 0.24))
    mixed = found[changed]
    assert mixed.min() >= 0 and mixed.max() <= 4e-3
    assert mixed.mean() == pytest.approx(2e-3, abs=4 * 4e-3 / math.sqrt(12 * len(mixed)))
    assert np.array_equal(flying(z, 1.0, 5e-3, np.random.default_rng(1)), z, equal_nan=True)


def test_all_lone_grains_can_be_lost_and_the_heap_stays(pour: gc.Pour) -> None:
    measures = Measures.of(pour.scene)
    before = dict(zip(measures.names, measures.of_pour(pour), strict=True))
    after = dict(zip(measures.names, measures.of_pour(pour, {"lost": 1.0}), strict=True))
    assert before["isolated_grains"] >= 5 and after["isolated_grains"] == 0
    assert after["clusters"] == before["clusters"] and after["max_z"] == before["max_z"]
    assert after["count_in_view"] < before["count_in_view"]


def test_a_share_of_lone_grains_is_lost_whole() -> None:
    # 400 bodies of 2 x 2 pixels, and a bar of 30 pixels that is no grain.
    is_grain = np.zeros((120, 84), dtype=bool)
    for i in range(20):
        for j in range(20):
            is_grain[4 * i : 4 * i + 2, 4 * j : 4 * j + 2] = True
    is_grain[100, 10:40] = True
    y, x = np.mgrid[:120, :84].astype(float)
    gone = lost(x, y, is_grain, 1.5, 1.5, 0.3, np.random.default_rng(2))
    assert not gone[100].any() and not gone[~is_grain].any()
    corners = gone[:80:4, :80:4]
    assert np.array_equal(corners, gone[1:80:4, 1:80:4])
    assert corners.sum() == pytest.approx(120, abs=4 * math.sqrt(400 * 0.21))


def test_every_fault_of_the_library_is_one_and_is_off_at_no_strength(pour: gc.Pour) -> None:
    measures = Measures.of(pour.scene)
    plain = measures.of_pour(pour)
    assert {effect.image for effect in LIBRARY if effect.image} == set(KINDS)
    for name in NAMES:
        (effect,) = by_name([name])
        assert effect.is_free and effect.numbers(0.5) == {} and effect.doc
        np.testing.assert_allclose(
            measures.of_pour(pour, effect.faults(0.0)), plain, rtol=1e-9, atol=1e-12
        )
        full = measures.of_pour(pour, effect.faults(1.0))
        assert np.isfinite(full).all() and np.abs(full - plain).max() > 1e-4
    # The same seed, the same faults.
    faults = {"flying": 0.3, "lost": 0.5}
    np.testing.assert_array_equal(measures.of_pour(pour, faults), measures.of_pour(pour, faults))


def plan(tmp: Path, *names: str) -> ArchivePlan:
    return ArchivePlan(
        scene=scene(),
        prior=gc.Prior.from_toml(PRIOR),
        conditions=(("start.base", 0.03, 0.05),),
        library=by_name(names),
        base=24,
        each=4,
    )


def test_one_pour_serves_all_effects_of_the_image(tmp_path: Path) -> None:
    folder = tmp_path / "archive"
    one = Archive(folder, plan(tmp_path, "camera.offset"))
    assert (one.plan.pours, one.plan.images) == (24, 6)
    with pytest.raises(TrainingDataError, match="base is missing"):
        one.pours()
    one.fill(threads=1, say=lambda _: None, progress=False)
    first = one.pours()
    plain = ~first.psi.any(axis=1)
    assert plain.sum() + first.left_out.total == 24
    strengths = first.psi[~plain, 0]
    assert 0 < len(strengths) <= 6 and np.abs(strengths).max() <= 1
    # A row with the offset is a plain row, its heights moved.
    column = first.names.index("mean_z")
    for row in np.nonzero(~plain)[0]:
        same = np.nonzero(plain & (first.theta == first.theta[row]).all(axis=1))[0]
        assert len(same) == 1
        gap = first.x[row, column] - first.x[same[0], column]
        assert gap == pytest.approx(1e-3 * first.psi[row, 0], rel=1e-6)
    # A further effect needs no further pour, and is read together with the first one.
    both = Archive(folder, plan(tmp_path, "camera.offset", "grains.lost"))
    assert both.plan.pours == 24
    both.fill(threads=1, say=lambda _: None, progress=False)
    second = both.pours()
    assert np.array_equal(second.x[: len(first.x)], first.x)
    assert (second.psi[len(first.x) :, 1] > 0).all() and len(second.x) > len(first.x)


def test_some_pours_of_an_effect_are_read_under_those_of_the_image(tmp_path: Path) -> None:
    names = "tilt.x", "count", "camera.offset", "camera.scale"
    asked = replace(plan(tmp_path, *names), base=32, each=20)
    archive = Archive(tmp_path / "archive", asked)
    assert (asked.pours, asked.images, asked.images_each) == (72, 8, 4)
    # 24 plain ones, 16 of each effect; 8 + 2 x 4 with their images.
    assert archive.missing == 72
    archive.fill(threads=1, say=lambda _: None, progress=False)
    assert archive.missing == 0
    assert {p.name for p in archive.folder.glob("images*")} == {
        "images",
        "images-tilt.x",
        "images-count",
    }
    order = [effect.name for effect in asked.library]
    tilt, count, offset, scale = (order.index(name) for name in names)
    rows = archive.pours()
    on = rows.psi != 0
    for k in (tilt, count):
        both = on[:, k] & on[:, offset]
        assert 0 < both.sum() <= 4 and on[both].sum() == 2 * both.sum()
        assert np.unique(rows.theta[both], axis=0).shape == (both.sum(), len(asked.prior.names))
    # A count is a whole number of grains.
    (effect,) = (one.at(asked.scene) for one in by_name(["count"]))
    grains = [effect.value(psi) for psi in rows.psi[on[:, count] & on[:, offset], count]]
    assert all(n == round(n) for n in grains)
    assert not (on[:, scale] & on[:, offset]).any()


def test_two_effects_of_the_image_are_read_together(tmp_path: Path) -> None:
    asked = replace(plan(tmp_path, "camera.offset", "grains.lost"), base=96)
    archive = Archive(tmp_path / "archive", asked)
    archive.fill(threads=1, say=lambda _: None, progress=False)
    rows = archive.pours()
    both = (rows.psi != 0).all(axis=1)
    assert 0 < both.sum() < 24
    order = [effect.name for effect in asked.library]
    highest, lone = rows.names.index("max_z"), rows.names.index("isolated_grains")
    k = order.index("camera.offset")
    for row in np.nonzero(both)[0]:
        same = (rows.theta == rows.theta[row]).all(axis=1)
        plain = rows.x[same & ~rows.psi.any(axis=1)]
        # Lost grains leave the highest point, and the offset leaves the lone ones.
        gap = rows.x[row, highest] - plain[0, highest]
        assert gap == pytest.approx(1e-3 * rows.psi[row, k], rel=1e-6)
        assert rows.x[row, lone] <= plain[0, lone]


def test_numbers_of_definitions_are_drawn_at_the_conditions_alone_as_well(tmp_path: Path) -> None:
    level = "camera.height_threshold", 1e-3, 2e-3
    plain = plan(tmp_path, "camera.blur")
    asked = replace(plain, conditions=(*plain.conditions, level), base=8)
    archive = Archive(
        tmp_path / "archive", replace(asked, places=({"start.base": 0.03}, {"start.base": 0.05}))
    )
    archive.fill(threads=1, say=lambda _: None, progress=False)
    height, drawn = archive.pours().condition.T
    assert set(height) == {0.0, 1.0}
    assert len(np.unique(drawn)) == 8 and 0 < drawn.min() < drawn.max() < 1


def test_the_forward_run_has_the_fault(tmp_path: Path, pour: gc.Pour) -> None:
    forward = Forward(tmp_path, 1)
    plain, moved = (forward.pours(pour.scene, [4], f) for f in ({}, {"offset": 5e-4}))
    column = Measures.of(pour.scene).names.index("mean_z")
    assert moved[0, column] - plain[0, column] == pytest.approx(5e-4, rel=1e-9)
    # Both are kept, each under its own name.
    assert forward.ran == 2
    assert np.array_equal(forward.pours(pour.scene, [4], {"offset": 5e-4}), moved)
    assert forward.ran == 2


def test_scenes_without_an_image_refuse_by_name(tmp_path: Path) -> None:
    observing = gc.Scene.from_toml(
        SCENE.replace("PROJECTION", "pinhole")
        + "\n[observe]\nrate = 50.0\n[observe.radius]\npercentiles = [50.0]\n"
    )
    colour = gc.Scene.from_toml(SCENE.replace("PROJECTION", "pinhole") + 'mask = "colour"\n')
    require_image(observing, [])
    with pytest.raises(ObservationError, match="grains.lost: .* statistics of its own"):
        require_image(observing, ["grains.lost"])
    with pytest.raises(ObservationError, match="camera.blur, grains.lost: .* by height"):
        require_image(colour, ["camera.blur", "grains.lost"])
    recordings = tuple(Path(f"{i}.png") for i in range(3))
    conditions = (Condition("one", {"start.base": 0.04}, FIT, recordings),)
    prior = gc.Prior.from_toml(PRIOR)
    with pytest.raises(ObservationError, match="camera.offset: effects of the image"):
        Task(observing, prior, conditions, by_name(["tilt.x", "camera.offset"]))
    # A task that names none has those that its scene can show.
    for name, text, expected in (
        ("image", scene().to_toml(), NAMES),
        ("observing", observing.to_toml(), []),
    ):
        (tmp_path / "scene.toml").write_text(text)
        (tmp_path / "prior.toml").write_text(PRIOR)
        for pour in ("a.npz", "b.npz", "c.npz"):
            (tmp_path / pour).write_bytes(b"")
        (tmp_path / f"{name}.toml").write_text(
            'scene = "scene.toml"\nprior = "prior.toml"\n[[conditions]]\nname = "one"\n'
            'at = { "start.base" = 0.04 }\nuse = "fit"\nrecordings = ["a.npz", "b.npz", "c.npz"]\n'
        )
        library = Task.load(tmp_path / f"{name}.toml").library
        assert [effect.name for effect in library if effect.image] == expected
    # A tolerance of lengths would forgive nothing of what is observed; `length.scale` does.
    text = (tmp_path / "observing.toml").read_text()
    for head in ('effects = ["tilt.x", "camera.scale"]', 'nuisances = { "camera.scale" = 0.005 }'):
        (tmp_path / "named.toml").write_text(f"{head}\n{text}")
        with pytest.raises(ObservationError, match="camera.scale: effects of the image"):
            Task.load(tmp_path / "named.toml")


def test_a_camera_beside_the_axis_moves_what_it_sees_and_nothing_else(pour: gc.Pour) -> None:
    measures = Measures.of(pour.scene)
    plain, aside = (
        dict(zip(measures.names, measures.of_pour(pour, faults), strict=True))
        for faults in ({}, {"aside_x": 4e-3})
    )
    frame = Frame.of(pour).with_({"aside_x": 4e-3, "aside_y": -2e-3}, 0)
    moved = Frame.of(pour).points() - frame.points()
    np.testing.assert_allclose(moved, np.broadcast_to([4e-3, -2e-3, 0.0], moved.shape), atol=1e-15)
    # Mass beside the axis; the paper's statistics are about the centroid.
    assert abs(aside["mass_cos_1"] - plain["mass_cos_1"]) > 0.05
    for name in measures.names[: measures.head]:
        assert aside[name] == pytest.approx(plain[name], rel=1e-9, abs=1e-12), name


def test_a_lens_that_is_not_the_stated_one_is_what_a_recording_shows(
    pour: gc.Pour, tmp_path: Path
) -> None:
    measures, seen = Measures.of(pour.scene), []
    for width in (0.3, 0.3 * 1.06):
        folder = tmp_path / f"{width:g}"
        camera = gc.Camera.overhead(height=0.3, field_width=width, pixels=300)
        camera.record(pour.positions, pour.radii, folder)
        # Told as one that sees 30 cm: what the other one sees is smaller by 1.06.
        toml = folder / "camera.toml"
        lines = toml.read_text().splitlines()
        told = ["fx = 300.0" if x.startswith("fx") else x for x in lines]
        toml.write_text("\n".join("fy = 300.0" if x.startswith("fy") else x for x in told))
        seen.append(measures.of_recording(folder / "depth.png", pour.scene, toml))
    right, wrong = seen
    plain, faulty = (measures.of_pour(pour, f) for f in ({}, {"lens": 1 / 1.06 - 1}))
    for name, ratio in (("mean_r", 1 / 1.06), ("max_z", 1.0), ("count_in_view", 1.06**-2)):
        i = measures.names.index(name)
        assert faulty[i] / plain[i] == pytest.approx(ratio, rel=0.02), name
        assert wrong[i] / right[i] == pytest.approx(faulty[i] / plain[i], rel=0.02), name
    # Where it stands is told in the lengths that are read.
    frame = Frame.with_faults(pour, {"aside_x": 4e-3, "lens": 0.1}, 0)
    moved = Frame.of(pour, 0.1).points() - frame.points()
    np.testing.assert_allclose(moved, np.broadcast_to([4e-3, 0.0, 0.0], moved.shape), atol=1e-15)


def test_height_maps_are_not_asked_where_the_axis_was() -> None:
    seen, of_map = (Measures.of(scene(kind)).names for kind in ("pinhole", "orthographic"))
    gone = {f"{what}_{wave}_1" for what in ("mass", "rim") for wave in ("cos", "sin")}
    assert set(seen) - set(of_map) == gone and set(of_map) < set(seen)
