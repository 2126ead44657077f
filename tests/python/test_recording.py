import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import granulcal as gc
from granulcal.errors import DoubtfulRecordingWarning
from granulcal.measured.recording import DamagedRecordingWarning, Lost
from granulcal.pours.compare import Scale, comparison_table, nearest_row, standardised_distance


@pytest.fixture(scope="module")
def pour() -> gc.Pour:
    return gc.simulate(gc.Scene.drop(0.03, count=500, preset="fast"), seed=2)


@pytest.fixture(scope="module")
def camera() -> gc.Camera:
    return gc.Camera.overhead(height=0.4, field_width=0.4, pixels=400)


def test_a_photograph_of_a_pour_has_the_pours_statistics(pour, tmp_path):
    # The scene's own camera, stored as a PNG: only the rounding of depth is between the two.
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=1920)
    image, toml = camera.record(pour.positions, pour.radii, tmp_path, depth_unit=1e-5)
    recording = gc.Recording.open(image, camera=toml)
    assert recording.depth is not None
    assert recording.depth.shape == (1920, 1920)
    assert recording.heights is None
    assert recording.frames == 1
    # No pixel of it flies: where grains are stacked, a rim may look as if it did.
    options = {"downsample": 20, "height_threshold": 1e-3, "flying_deg": 90.0}
    seen = recording.formation(**options).statistics()
    for name, value in pour.statistics().to_dict().items():
        assert seen[name] == pytest.approx(value, rel=0.01, abs=1e-4), name


def test_an_array_of_depths_is_a_recording(pour, camera, tmp_path):
    image, toml = camera.record(pour.positions, pour.radii, tmp_path, depth_unit=1e-4)
    stored = gc.Recording.open(image, camera=toml)
    counts = np.rint(np.asarray(stored.depth, float) / 1e-4).astype(np.uint16)
    wanted = stored.statistics()
    for name, array in {"metres": stored.depth, "counts": counts, "frames": counts[None]}.items():
        np.save(tmp_path / f"{name}.npy", array)
        read = gc.Recording.open(tmp_path / f"{name}.npy")  # camera.toml lies beside it.
        for statistic, value in wanted.to_dict().items():
            assert read.statistics()[statistic] == pytest.approx(value, rel=1e-3, abs=1e-5), name


def test_an_image_without_grains_says_what_ground_it_shows(camera, tmp_path):
    flat = np.full((400, 400), 400, np.uint16)
    np.save(tmp_path / "flat.npy", flat)
    text = (tmp_path / "camera.toml").write_text
    lens = "width = 400\nheight = 400\nfx = 400\nfy = 400\ncx = 199.5\ncy = 199.5\n"
    text(f"{lens}depth_unit = 1e-4\n")
    with pytest.raises(ValueError, match=r"the image shows 0.04 m x 0.04 m of the ground"):
        gc.Recording.open(tmp_path / "flat.npy").formation()


@pytest.mark.parametrize("tilt", [(3.0, 0.0), (-2.0, 4.0)])
def test_tilt_and_noise_are_undone(pour, camera, tmp_path, tilt):
    straight = camera.record(pour.positions, pour.radii, tmp_path / "straight")
    tilted = camera.tilted(x_deg=tilt[0], y_deg=tilt[1]).record(
        pour.positions, pour.radii, tmp_path / "tilted", depth_noise=3e-4, seed=1
    )
    expected = gc.Recording.open(straight[0], camera=straight[1]).statistics()
    recording = gc.Recording.open(tilted[0], camera=tilted[1])
    angle = np.degrees(np.arccos(np.cos(np.radians(tilt[0])) * np.cos(np.radians(tilt[1]))))
    assert recording.plane.tilt_deg == pytest.approx(angle, abs=0.05)
    for name in ("mean_r", "sd_r"):
        assert recording.statistics()[name] == pytest.approx(expected[name], rel=0.06), name
    # The highest of many noisy pixels lies up to three sds of the noise too high.
    assert recording.statistics()["max_z"] == pytest.approx(expected["max_z"], abs=3 * 3e-4)


def test_what_the_scenes_images_do_not_show_is_cut_off(pour, tmp_path):
    """A grain that has rolled farther than the scene's camera sees is in no simulated image."""
    scene = pour.scene.with_({"camera.field_width": 0.4, "camera.pixels": 400})
    positions = np.vstack([pour.positions, [[0.3, 0.0, pour.radii[0]]]])
    radii = np.append(pour.radii, pour.radii[0])
    seen = {}
    for name, width in (("as the scene", 0.4), ("wide", 0.8)):
        camera = gc.Camera.overhead(height=0.4, field_width=width, pixels=int(1000 * width))
        image, toml = camera.record(positions, radii, tmp_path / name)
        seen[name] = gc.Recording.open(image, camera=toml)
    assert seen["wide"].formation(border_px=0).statistics()["max_r"] > 0.28
    own, wide = (each.formation(**scene.reading).statistics() for each in seen.values())
    for name in ("max_r", "sd_x", "sd_y", "mean_r"):
        assert wide[name] == pytest.approx(own[name], rel=0.03), name
    with pytest.raises(ValueError, match="field_width"):
        seen["wide"].formation(field_width=-1.0)


def test_the_floor_of_a_tray_is_looked_at_alone(pour, tmp_path):
    """Its rim and the table around it had been grains, or the ground."""
    camera = gc.Camera.overhead(height=0.4, field_width=0.8, pixels=400)
    depth = camera.render(pour.positions, pour.radii)
    pixels = np.abs(np.arange(400) - 199.5)
    out = np.maximum(*np.meshgrid(pixels, pixels))
    depth[out > 150] = 0.415
    depth[(out > 150) & (out <= 155)] = 0.38
    lens = {"fx": 200.0, "fy": 200.0, "cx": 199.5, "cy": 199.5}
    tray = gc.Recording.from_depth(depth, **lens)
    alone = gc.Recording.from_depth(camera.render(pour.positions, pour.radii), **lens)
    floor = (50, 50, 300, 300)
    got, want = tray.formation(region=floor), alone.formation(region=floor)
    assert np.array_equal(got.points, want.points) and got.mask.shape == (300, 300)
    assert tray.formation().volume > 2 * got.volume
    np.save(tmp_path / "tray.npy", depth)
    text = "width = 400\nheight = 400\nfx = 200.0\nfy = 200.0\ncx = 199.5\ncy = 199.5\n"
    toml = tmp_path / "tray.toml"
    toml.write_text(f"{text}[segmentation]\nregion = {list(floor)}\n")
    stated = gc.Recording.open(tmp_path / "tray.npy", camera=toml)
    assert np.array_equal(stated.formation().points, got.points)
    with pytest.raises(ValueError, match=r"edge of a region \[px\] must be in \[1, 400\], got"):
        tray.formation(region=(350, 0, 100, 100))
    wrong: Any = {"region": (1, 2, 3)}
    with pytest.raises(TypeError, match=r"must be whole pixels \(x, y, width, height\), got"):
        tray.formation(**wrong)


def test_a_png_finds_the_camera_that_lies_beside_it(pour, camera, tmp_path):
    image, toml = camera.record(pour.positions, pour.radii, tmp_path / "a" / "frames")
    stored = gc.Recording.open(image, camera=toml)
    folder = image.parent

    def lens(path):
        return gc.Recording.open(path).lens

    assert lens(image) == lens(folder) == stored.lens
    # One for several folders.
    toml.rename(folder.parent / "camera.toml")
    assert lens(image) == lens(folder) == stored.lens
    # What bears the image's own name comes first.
    text = (folder.parent / "camera.toml").read_text()
    image.with_suffix(".toml").write_text(
        text.replace("fx = ", "fx = 1").replace("fy = ", "fy = 1")
    )
    assert lens(image) not in (None, stored.lens)
    image.with_suffix(".toml").unlink()
    (folder.parent / "camera.toml").unlink()
    with pytest.raises(ValueError, match="the camera must be given .* beside them as camera.toml"):
        gc.Recording.open(image)


def test_frames_in_memory_are_what_their_files_are(pour, camera, tmp_path):
    image, toml = camera.record(pour.positions, pour.radii, tmp_path, depth_unit=1e-4)
    stored = gc.Recording.open(image, camera=toml)
    assert stored.depth is not None and stored.lens is not None
    lens = {name: stored.lens[name] for name in ("fx", "fy", "cx", "cy")}
    counts = np.rint(stored.depth / 1e-4).astype(np.uint16)
    for depth, unit in ((stored.depth, None), (counts, 1e-4), ([counts, counts], 1e-4)):
        read = gc.Recording.from_depth(depth, **lens, unit=unit)
        assert read.depth is not None
        np.testing.assert_allclose(read.depth, stored.depth, atol=1e-7)
        assert read.frames == np.ndim(depth) - 1
        found, expected = read.statistics(), stored.statistics()
        np.testing.assert_allclose(np.asarray(found), np.asarray(expected), rtol=1e-4, atol=1e-6)
    # What a camera writes where it saturates.
    blind = counts.copy()
    blind[len(blind) // 2] = 65535
    for depth in (blind, blind.astype(np.int32), np.stack([blind, blind]), blind.astype(float)):
        read = gc.Recording.from_depth(depth, **lens, unit=1e-4)
        np.testing.assert_array_equal(read.depth == 0, (blind == 65535) | (counts == 0))
    nothing = np.where(stored.depth > 0.37, np.nan, stored.depth)
    assert (gc.Recording.from_depth(nothing, **lens).depth == 0).sum() == (~(nothing > 0)).sum()
    # As readers hand them out: turned by a transposition, with one channel, of another pour.
    turned = {**lens, "fx": lens["fy"], "fy": lens["fx"], "cx": lens["cy"], "cy": lens["cx"]}
    across = gc.Recording.from_depth(stored.depth.T, **turned).statistics()
    assert across["max_z"] == pytest.approx(stored.statistics()["max_z"], rel=1e-6)
    channel = gc.Recording.from_depth(stored.depth[:, :, None], **lens)
    np.testing.assert_array_equal(channel.depth, stored.depth)
    camera.save(stored.depth.T[::-1].T, tmp_path / "mirrored.png", tmp_path / "mirrored.toml")
    with pytest.warns(UserWarning, match="depth array: frame 1"):
        gc.Recording.from_depth([stored.depth, stored.depth - 0.01], **lens)
    for depth, unit, message in (
        (counts, None, r"uint16.*unit=0\.001"),
        (counts, -1e-4, "unit must be positive"),
        (1e3 * stored.depth, None, "depth array: the depths must be at most 100 m"),
        (0.0 * stored.depth, None, "depth array: .*must carry depth"),
    ):
        with pytest.raises(ValueError, match=message):
            gc.Recording.from_depth(depth, **lens, unit=unit).formation()
    with pytest.raises(ValueError, match=r"shape \(h, w\) or \(k, h, w\), got \(5,\)"):
        gc.Recording.from_depth(np.ones(5), **lens)
    with pytest.raises(ValueError, match="fx"):
        gc.Recording.from_depth(stored.depth, **{**lens, "fx": -1.0})


def test_a_recording_of_which_half_is_hidden_is_doubtful_in_python_too(pour, tmp_path):
    scene, prior = pour.scene, gc.Prior.default()
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=960)
    image, toml = camera.record(pour.positions, pour.radii, tmp_path)
    whole = gc.Recording.open(image, camera=toml)
    depth = np.array(whole.depth)
    depth[:, : depth.shape[1] // 2] = 0
    camera.save(depth, tmp_path / "half.png", toml)
    half = gc.Recording.open(tmp_path / "half.png", camera=toml)
    own = {**scene.reading, "height_threshold": scene.get("camera.height_threshold")}
    assert whole.doubts(scene, prior, **own) == []
    assert any("outline nothing is seen" in told for told in half.doubts(scene, prior, **own))
    with (
        pytest.warns(DoubtfulRecordingWarning) as warned,
        pytest.raises(ValueError, match="show one formation"),
    ):
        gc.calibrate_within(scene, prior, [half, half], out=tmp_path / "out")
    assert any("half.png: at" in str(each.message) for each in warned)
    with pytest.raises(TypeError, match=r"what Recording.open returns"):
        gc.calibrate_within(scene, prior, cast(Any, ["half.png"]), out=tmp_path / "out")
    for wrong, told in (
        (["half.png"], "got 'half.png' in it"),
        (half, r"got Recording\('.*half.png"),
    ):
        with pytest.raises(TypeError, match=told):
            gc.calibrate_within(scene, prior, cast(Any, wrong), out=tmp_path / "out")
    # They had no attribute `with_`, or `parameters`.
    for words, told in (
        ((cast(Any, "scene.toml"), prior), "scene must be a Scene, .* got 'scene.toml'"),
        ((scene, cast(Any, "prior.toml")), "prior must be a Prior, .* got 'prior.toml'"),
    ):
        with pytest.raises(TypeError, match=told):
            gc.calibrate_within(*words, [half], out=tmp_path / "out")


def test_segmentation_options_are_honoured(pour, camera, tmp_path):
    image, toml = camera.record(pour.positions, pour.radii, tmp_path)
    recording = gc.Recording.open(image, camera=toml)
    high = recording.formation(height_threshold=0.005)
    assert high.threshold == 0.005
    assert high.points[:, 2].min() > 0.005
    coarse = recording.formation(downsample=4)
    assert coarse.mask.shape == (100, 100)
    assert coarse.mask.sum() == len(coarse.points)
    heights = coarse.height_image()
    assert np.nanmax(heights) == coarse.points[:, 2].max()
    assert np.abs(coarse.points[:, :2].mean(axis=0)).max() < 1e-12
    with pytest.raises(ValueError, match="not both"):
        recording.formation(height_threshold=0.002, threshold_floor=0.001)
    with pytest.raises(ValueError, match="none of .* pixels belongs to a grain"):
        recording.formation(height_threshold=0.5)
    same = recording.formation(height_threshold=None, border_px=None)
    assert np.array_equal(same.mask, recording.formation().mask)
    wrong: Any = {"border": 3}
    with pytest.raises(TypeError, match="unexpected keyword argument .border.; allowed are height"):
        recording.formation(**wrong)
    wrong = {"border_px": "wide"}
    with pytest.raises(TypeError, match="border_px: "):
        recording.level(**wrong)


def test_a_height_map_is_read(tmp_path):
    y, x = np.mgrid[-40:40, -40:40] * 1.0
    heights = np.maximum(0.0, 20.0 - np.hypot(x, y))
    path = tmp_path / "cone.npz"
    np.savez(path, depthmap=heights, xres=1.0, yres=1.0, zres=1.0, scale="mm")
    recording = gc.Recording.open(path)
    assert recording.depth is None
    assert recording.heights is not None
    assert recording.heights.shape == (80, 80)
    assert recording.statistics()["max_z"] == pytest.approx(0.020, abs=2e-4)


# Recordings by other people's writers; see crates/dataset/tests/messages.rs for what they show.
_RECORDINGS = Path(__file__).parents[2] / "crates" / "dataset" / "tests" / "data" / "recordings"


def test_recordings_of_messages_are_read():
    for name in ("realsense_bz2.bag", "ros2_32fc1_lz4.mcap", "foxglove_raw.mcap"):
        recording = gc.Recording.open(_RECORDINGS / name)
        assert (recording.frames, recording.whole_frames) == (3, 3)
        assert recording.lost is None
        assert recording.topic is not None
        assert recording.depth is not None
        assert recording.depth.shape == (8, 12)
        # Pixel (u, v) = (5, 3) is on the block and never a hole: (500 + 10 + 9 - 40 + frame) mm.
        assert recording.depth[3, 5] == pytest.approx(0.480)
        assert 0 < recording.statistics()["max_z"] < 0.1
    one = gc.Recording.open(_RECORDINGS / "foxglove_raw.mcap", frames=1, first_frame=0)
    assert one.depth is not None
    assert one.depth[3, 5] == pytest.approx(0.479)
    every = gc.Recording.open(_RECORDINGS / "foxglove_raw.mcap", frames=None)
    assert every.frames == 3
    with pytest.raises(ValueError, match=r"there are: /depth.*no topic /nowhere"):
        gc.Recording.open(_RECORDINGS / "foxglove_raw.mcap", topic="/nowhere")
    with pytest.raises(ValueError, match="at least 1"):
        gc.Recording.open(_RECORDINGS / "foxglove_raw.mcap", frames=0)


def test_a_film_of_a_pour_is_a_recording(tmp_path):
    film = tmp_path / "pour.mcap"
    scene = tmp_path / "scene.toml"
    scene.write_text(gc.Scene.drop(0.03, count=200, preset="fast").to_toml())
    words = ["granulcal", "simulate", str(scene), "--seed", "2", "--mcap", str(film), "--json"]
    assert gc._native.run_cli(words) == 0
    seen = gc.Recording.open(film, frames=1).formation(height_threshold=1e-3).statistics()
    pour = gc.simulate(gc.Scene.load(scene), seed=2)
    for name in ("max_z", "mean_r"):
        assert seen[name] == pytest.approx(pour.statistics()[name], rel=0.02), name


def test_a_damaged_recording_warns_and_counts(tmp_path):
    whole = (_RECORDINGS / "ros2_16uc1_none.mcap").read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: len(whole) // 2])
    with pytest.warns(DamagedRecordingWarning, match=r"cut\.mcap: .* lost; .*byte"):
        recording = gc.Recording.open(cut)
    assert recording.frames in (1, 2)
    assert recording.lost is not None
    assert recording.lost.how == "at least"
    assert recording.damage
    assert str(Lost(0, "at least")) == "an unknown number of frames lost"
    assert str(Lost(2, "about")) == "about 2 frames lost"
    cut.write_bytes(whole[:100])
    with pytest.raises(ValueError, match=r"cut\.mcap"):
        gc.Recording.open(cut)


def test_errors_name_the_file(pour, camera, tmp_path, tmp_path_factory):
    image, toml = camera.record(pour.positions, pour.radii, tmp_path)
    with pytest.raises(FileNotFoundError, match=r"missing\.png"):
        gc.Recording.open(tmp_path / "missing.png", camera=toml)
    alone = shutil.copy(image, tmp_path_factory.mktemp("alone"))
    with pytest.raises(ValueError, match="camera"):
        gc.Recording.open(alone)
    with pytest.raises(ValueError, match="radii"):
        camera.render(pour.positions, pour.radii[:-1] * 0 + 1)
    text = tmp_path / "notes.txt"
    text.write_text("no image")
    with pytest.raises(ValueError, match=r"notes\.txt"):
        gc.Recording.open(text)


def test_noise_belongs_to_the_seed(pour, camera):
    def image(seed: int) -> np.ndarray:
        return camera.render(pour.positions, pour.radii, depth_noise=1e-3, seed=seed)

    assert np.array_equal(image(1), image(1))
    assert not np.array_equal(image(1), image(2))


def test_distances_are_in_training_deviations(small_data):
    scale = Scale.of(small_data)
    a = small_data.x[0]
    assert np.allclose(scale.sd, small_data.x.std(axis=0, ddof=1))
    assert standardised_distance(a, a, scale) == 0
    assert standardised_distance(a + scale.sd, a, scale) == pytest.approx(4.0)
    assert nearest_row(a, small_data) == 0
    rows = comparison_table(a, [a + 3 * scale.sd, a + scale.sd], scale)
    assert [row.name for row in rows] == list(small_data.x_names)
    assert all(row.difference == pytest.approx(2.0) for row in rows)
    assert comparison_table(a, [a - 3 * scale.sd], scale)[0].is_far


def test_the_nearest_pour_is_told_by_what_varies():
    x = np.column_stack([np.random.default_rng(0).random((30, 3)), np.full(30, 7.0)])
    data = cast(Any, SimpleNamespace(x=x, is_usable=np.ones(30, bool)))
    assert nearest_row([*x[12, :3], 7.5], data) == 12


def test_a_statistic_that_never_varied_counts_only_where_it_differs():
    scale = Scale(np.array([0.0, 1.0]))
    assert scale.difference([1.0, 2.0], [1.0, 1.0]).tolist() == [0.0, 1.0]
    assert np.isinf(scale.difference([2.0, 2.0], [1.0, 1.0])[0])


@pytest.mark.slow
def test_no_pour_of_the_prior_is_taken_for_a_ruler_or_two_heaps_at_any_width_of_pixels():
    camera = gc.Camera.overhead(height=0.45, field_width=0.6, pixels=520)
    prior = gc.Prior.default()
    for seed, theta in enumerate(prior.sample(30, seed=8)):
        scene = gc.Scene.funnel(height=(0.03, 0.06, 0.12, 0.2)[seed % 4])
        scene = scene.with_(dict(zip(prior.names, map(float, theta), strict=True)))
        pour = gc.simulate(scene, seed=seed)
        middle = [*np.median(pour.positions[:, :2], axis=0), 0.0]
        at = pour.positions - middle
        depth = camera.render(at, pour.radii, depth_noise=2e-4, seed=seed)
        lens = dict(fx=390.0, fy=390.0, cx=259.5, cy=259.5)
        recording = gc.Recording.from_depth(depth, **lens)
        for times in (4, 8, 14, 20):  # Pixels of 0.3 to 1.5 diameters.
            try:
                said = recording.doubts(scene.with_({"camera.downsample": times}), prior)
            except ValueError as error:
                # What has rolled out of view.
                assert "none of" in str(error), error
                continue
            told = [text for text in said if "flat" in text or "apart" in text]
            assert told == [], (scene.to_toml(), times)
