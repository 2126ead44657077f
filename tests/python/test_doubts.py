"""What is said of recordings that a scene's own pours give, and of such that were spoiled."""

from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal import _native
from granulcal.demo import measured_data
from granulcal.measured.plausible import doubts, doubts_of_frames

TEXT = """
name = "small funnel"
preset = "fast"
[grains]
count = 500
diameter = 0.005
density = 900.0
[start]
kind = "grid"
counts = [8, 8, 8]
spacing = 0.009
jitter = 0.0001
base = -0.004
[funnel]
height = 0.08
rim_radius = 0.06
stem_radius = 0.018
cone_length = 0.07
stem_length = 0.01
[end]
horizon = 3.0
[camera]
height = 0.35
field_width = 0.4
pixels = 320
downsample = 4
height_threshold = 0.0015
"""

PRIOR = """
[[parameter]]
path = "material.sliding_friction"
distribution = "log_uniform"
low = 0.05
high = 2.0
[[parameter]]
path = "material.rolling_friction"
distribution = "log_uniform"
low = 1e-3
high = 1.0
"""

MATERIAL = gc.Material(sliding_friction=0.6, rolling_friction=0.3, restitution=0.5)


@pytest.fixture(scope="module")
def scene() -> gc.Scene:
    return gc.Scene.from_toml(TEXT)


@pytest.fixture(scope="module")
def prior() -> gc.Prior:
    return gc.Prior.from_toml(PRIOR)


def seen(depth: np.ndarray, stretch: float = 1.0, bow: float = 0.0) -> gc.Recording:
    """The recording of a depth image with a lens that is misread and a ground that is bent."""
    side = len(depth)
    lens = side * 0.35 / 0.4
    place = (np.arange(side) - 0.5 * (side - 1)) / (0.5 * side)
    bent = depth - bow * (place[:, None] ** 2 + place**2)
    at = dict(cx=0.5 * side - 0.5, cy=0.5 * side - 0.5)
    return gc.Recording.from_depth(bent, fx=lens / stretch, fy=lens, **at)


@pytest.fixture(scope="module")
def heap(scene: gc.Scene) -> np.ndarray:
    return gc.simulate(scene, MATERIAL, seed=2).depth_image()


def test_a_recording_is_read_at_the_threshold_of_its_scene(scene, prior, heap, tmp_path):
    recording = seen(heap)
    assert scene.reading["scene_threshold"] == 0.0015
    assert recording.formation(**scene.reading).threshold == 0.0015
    assert recording.doubts(scene, prior) == []
    # What is stated comes first, and is told.
    stated = recording.formation(**scene.reading, threshold_floor=0.003)
    assert stated.threshold == 0.003
    (told,) = recording.doubts(scene, prior, **scene.reading, height_threshold=0.001)
    assert "from 1 mm on, in the scene's images from 1.5 mm on" in told
    by_colour = gc.Scene.from_toml(TEXT + 'mask = "colour"\n')
    assert "scene_threshold" not in by_colour.reading
    # An image that is rendered says it itself.
    (tmp_path / "s.toml").write_text(TEXT)
    words = ["granulcal-cli", "render", str(tmp_path / "s.toml"), "--set", "grains.count=60"]
    assert _native.run_cli([*words, "-o", str(tmp_path / "pile.png")]) == 0
    assert gc.Recording.open(tmp_path / "pile.png").formation().threshold == 0.0015


def test_a_heap_that_is_stretched_or_lies_on_a_bent_ground_is_told(scene, prior, heap):
    (long,) = seen(heap, stretch=1.7).doubts(scene, prior)
    assert "times as long as wide" in long and "fx and fy" in long
    told = " ".join(seen(heap, bow=0.001).doubts(scene, prior))
    assert "the ground is bent: its middle lies 1 mm off its edges" in told


@pytest.mark.parametrize("times", [0.25, 4, 10])
def test_depths_in_another_unit_are_asked_for_by_the_distance_of_the_ground(
    scene, prior, heap, times
):
    """A heap that was a quarter as large had been inferred from without a word of it."""
    told = seen(times * heap).doubts(scene, prior)
    at = f"the ground is {0.35 * times:.4g} m from the camera, of the scene's images 0.35 m"
    (asked,) = [text for text in told if text.startswith(at)]
    assert asked.endswith("is the unit of the depths right (depth_unit)?")


def test_frames_of_one_pour_are_told_and_pours_are_not(scene, prior, heap):
    """Five frames of one pour, given one by one, had counted as five pours without a word."""
    other = gc.simulate(scene, seed=3).depth_image()
    noise = np.random.default_rng(1)
    first, again, second = (
        seen(depth + noise.normal(0.0, 2e-4, depth.shape)) for depth in (heap, heap, other)
    )
    names = ["a.png", "b.png", "c.png"]
    (told,) = doubts_of_frames(scene, prior, [first, again, second], names)
    assert told.startswith("a.png, b.png show the same grains") and "into a folder" in told
    assert told in doubts(scene, prior, [first, again, second], names)
    assert doubts_of_frames(scene, prior, [first, second], names[:2]) == []
    assert doubts_of_frames(scene, prior, [first], names[:1]) == []


def test_frames_of_one_heap_are_told_under_a_stereo_cameras_noise(scene, prior, heap):
    """At 1 mm a pixel frames of one heap had counted as pours of their own without a word."""
    other = gc.simulate(scene, MATERIAL, seed=3).depth_image()
    noise = np.random.default_rng(2)
    first, again, second = (
        seen(depth + noise.normal(0.0, 1e-3, depth.shape)) for depth in (heap, heap, other)
    )
    (told,) = doubts_of_frames(scene, prior, [first, again, second], ["a", "b", "c"])
    assert told.startswith("a, b show the same grains")


def test_measured_mounds_are_no_frames_of_one_pour(scene, prior):
    folder = measured_data()
    paths = sorted(folder.glob("granular-impact-kinect/data/[cf]*.npz")) if folder else []
    if not paths:
        pytest.skip("measured maps are absent: set GRANULCAL_DATA to the folder of their sets")
    maps = [gc.Recording.open(path) for path in paths]
    for diameter in (0.003, 0.006):
        of_size = scene.with_({"grains.diameter": diameter})
        assert doubts_of_frames(of_size, prior, maps, [path.name for path in paths]) == []


def test_an_image_where_one_stands_takes_the_camera_of_the_folder_above(tmp_path, monkeypatch):
    """`camera.toml` above was found by `pours/0.png` and not by `0.png` from within pours/."""
    (tmp_path / "pours").mkdir()
    for name in ("camera.toml", "pours/0.png"):
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path / "pours")
    for name in ("0.png", "./0.png", "."):
        found = _native.camera_beside(Path(name))
        assert found is not None and found.resolve() == (tmp_path / "camera.toml").resolve()


def test_a_height_map_tells_no_distance(scene, prior, heap, tmp_path):
    side = len(heap)
    pitch = 0.4 / side
    arrays = {"depthmap": 0.35 - heap, "xres": pitch, "yres": pitch, "zres": 1.0, "scale": "m"}
    np.savez(tmp_path / "map.npz", **arrays)
    told = gc.Recording.open(tmp_path / "map.npz").doubts(scene, prior)
    assert not any("from the camera" in text for text in told), told


@pytest.mark.slow
def test_a_scenes_own_pours_are_hardly_doubted_and_spoiled_ones_are(scene, prior):
    own, long, heaps, bent, pours = 0, 0, 0, 0, 0
    for seed, theta in enumerate(prior.sample(60, seed=11)):
        pour = gc.simulate(scene.with_(dict(zip(prior.names, theta, strict=True))), seed=seed)
        if pour.status == "jammed":
            continue
        depth = pour.depth_image()
        try:
            told = seen(depth).doubts(scene, prior)
        except ValueError as error:
            # What has rolled out of view.
            assert "none of" in str(error), error
            continue
        pours += 1
        own += told != []
        bent += any("bent" in text for text in seen(depth, bow=0.001).doubts(scene, prior))
        if pour.status == "at_rest":
            heaps += 1
            said = seen(depth, stretch=1.6).doubts(scene, prior)
            long += any("times as long as wide" in text for text in said)
    assert own <= 3 and bent == pours and long >= 0.9 * heaps > 0, (own, bent, pours, long, heaps)
