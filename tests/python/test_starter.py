import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.pours.scene import BUILT_IN
from granulcal.starter.folder import D435, FILES, lens_of, scene_text, write_folder
from granulcal.starter.numbers import set_numbers
from granulcal.starter.samples import HIDDEN


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of `init` with sixty grains, and its sample recordings."""
    place = tmp_path_factory.mktemp("start") / "couscous"
    words = ["init", str(place), "--scene", "drop", "--preset", "fast", "--set", "grains.count=60"]
    assert main(words) == 0
    assert main(["sample", str(place)]) == 0
    return place


@pytest.mark.parametrize("name", BUILT_IN)
def test_the_commented_scene_is_the_built_in_one_under_another_camera(name: str) -> None:
    scene, built_in = gc.Scene.from_toml(scene_text(name, D435)), gc.Scene.built_in(name)
    paths = ["grains.count", "grains.diameter", "grains.density", "end.horizon"]
    paths += [f"material.{key}" for key in ("sliding_friction", "rolling_friction", "restitution")]
    paths += ["funnel.height", "funnel.stem_radius"] if name == "funnel" else ["start.height"]
    assert [scene.get(path) for path in paths] == [built_in.get(path) for path in paths]
    # About a grain: as coarse as the paper's images are.
    assert 0.8 < scene.ground_resolution / scene.get("grains.diameter") < 1.7


def test_init_writes_four_files_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = write_folder(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(FILES)
    assert scene.get("funnel.height") == 0.12
    assert gc.Prior.load(tmp_path / "prior.toml") == gc.Prior.default()
    assert main(["init", str(tmp_path)]) == 1
    assert "scene.toml" in capsys.readouterr().err
    assert main(["init", str(tmp_path), "--force", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["files"]) == 4
    assert main(["init", str(tmp_path / "x"), "--set", "grains.count"]) == 2


def test_numbers_change_and_comments_stay(tmp_path: Path) -> None:
    write_folder(tmp_path)
    path = tmp_path / "scene.toml"
    before = path.read_text().count("#")
    scene = set_numbers(path, {"grains.count": 300, "preset": "fast"})
    assert (scene.get("grains.count"), scene.preset) == (300, "fast")
    assert path.read_text().count("#") == before
    with pytest.raises(ValueError, match="states no tangential_restitution"):
        set_numbers(path, {"material.tangential_restitution": 0.1})


def test_the_samples_are_one_formation_in_three_formats(folder: Path) -> None:
    pytest.importorskip("rosbags")
    camera = folder / "camera.toml"
    seen = {
        name: gc.Recording.open(folder / f"couscous.{name}", camera=camera)
        for name in ("bag", "mcap", "png")
    }
    assert [recording.frames for recording in seen.values()] == [10, 10, 1]
    for name in ("bag", "mcap"):
        lens = seen[name].lens
        assert lens is not None and lens["fx"] == pytest.approx(D435.fx)
        assert (lens["width"], lens["cx"]) == (640, 319.5)
        statistics = seen[name].statistics()
        # The noise of ten frames and of four; the rest is the same pour.
        assert statistics["mean_r"] == pytest.approx(seen["png"].statistics()["mean_r"], rel=0.1)
        # The camera of the samples is tilted by 1.5 and -1 degrees.
        assert seen[name].plane.tilt_deg == pytest.approx(np.hypot(1.5, 1.0), abs=0.15)
    assert seen["bag"].depth_unit == pytest.approx(1e-4)
    truth = json.loads((folder / "truth.json").read_text())
    assert truth["material"]["material.sliding_friction"] == HIDDEN.sliding_friction


def test_a_folder_is_fitted_to_the_lens_of_a_recording(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    lens = lens_of(folder / "couscous.bag")
    assert lens.distance == pytest.approx(0.4, rel=0.01) and lens.unit == pytest.approx(1e-4)
    assert main(["init", str(tmp_path), "--recording", str(folder / "couscous.mcap")]) == 0
    scene = gc.Scene.load(tmp_path / "scene.toml")
    assert scene.get("camera.pixels") == 480
    assert scene.get("camera.field_width") == pytest.approx(480 * 0.4 / D435.fx, rel=0.01)


@pytest.mark.parametrize(
    ("noise", "threshold"), [(0.0, 1e-3), (3.3e-4, 1e-3), (3.7e-4, 1.2e-3), (4e-4, 1.2e-3)]
)
def test_the_threshold_is_not_within_the_noise_that_was_found(
    noise: float, threshold: float
) -> None:
    """Of 0.37 mm it was 1.1 mm, and the first look at the recording warned of it."""
    assert replace(D435, noise=noise).threshold == threshold


def test_images_are_compared_at_a_pixel_about_as_wide_as_the_grains_that_are_set(
    tmp_path: Path,
) -> None:
    """It was that of grains of 4 mm, whatever was set, and called about a grain."""
    assert main(["init", str(tmp_path), "--set", "grains.diameter=0.002"]) == 0
    scene = gc.Scene.load(tmp_path / "scene.toml")
    assert scene.get("grains.diameter") == 0.002
    assert 0.8 < scene.ground_resolution / 0.002 < 1.7
    told = f"{1e3 * scene.ground_resolution:.1f} mm, {scene.ground_resolution / 0.002:.1f} grain"
    assert f"here {told} diameters.\n" in (tmp_path / "scene.toml").read_text()


def test_grains_of_two_metres_are_refused_by_what_the_camera_sees(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for scene in BUILT_IN:
        words = ["init", str(tmp_path / "new"), "--scene", scene]
        assert main([*words, "--set", "grains.diameter=2"]) == 2
        told = capfd.readouterr().err
        assert "grains.diameter must be at most 0.393 m, for the camera sees 0.492 m" in told
        assert "got 2" in told and not (tmp_path / "new").exists()
        for wrong in ("0", "-0.004"):
            assert main([*words, "--set", f"grains.diameter={wrong}"]) == 2
            assert "grains.diameter must be positive and finite" in capfd.readouterr().err


def test_a_camera_too_far_for_the_grains_is_told_before_the_first_pour(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Counts of 0.1 mm read as millimetres: 4 m to the ground had been written without a word."""
    good = (folder / "camera.toml").read_text()
    camera = tmp_path / "camera.toml"
    camera.write_text(good.replace("depth_unit = 0.0001", "depth_unit = 0.001"))
    words = ["init", str(tmp_path / "new"), "--recording", str(folder / "couscous.png"), "--json"]
    assert main([*words, "--camera", str(camera)]) == 0
    (told,) = json.loads(capfd.readouterr().out)["warnings"]
    assert "a pixel is 10.2 mm wide on the ground, 4 m" in told and "grains are 4 mm" in told
    assert "another than 0.001 m per count" in told and "depth_unit" in told
    assert main([*words, "--camera", str(folder / "camera.toml"), "--force"]) == 0
    captured = capfd.readouterr()
    assert json.loads(captured.out)["warnings"] == [] and "warning" not in captured.err


def test_the_wall_is_flat_and_fits_a_sensor(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    levelled = gc.Recording.open(folder / "wall.bag").level()
    assert not levelled.mask.any() and levelled.ground_sd < 1e-3
    out = tmp_path / "sensor.toml"
    words = ["fit-sensor", str(folder / "wall.bag"), "--baseline", "0.05", "--sessions", "2"]
    assert main([*words, "--frames", "3", "-o", str(out)]) == 0
    assert 'kind = "stereo"' in out.read_text()


def test_the_task_of_the_samples_can_be_loaded(folder: Path) -> None:
    task = gc.Task.load(folder / "loop.toml")
    assert [len(condition.recordings) for condition in task.conditions] == [2, 2]
    assert task.paths == ("start.height",)


def test_a_built_in_scene_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "drop", "--set", "grains.count=60"]) == 0
    scene = gc.Scene.from_toml(capfd.readouterr().out)
    assert scene == gc.Scene.built_in("drop").with_({"grains.count": 60})


def test_what_is_not_there_says_what_would_be(capfd: pytest.CaptureFixture[str]) -> None:
    assert main(["sample", "nowhere"]) == 2
    assert "`granulcal init nowhere` writes it" in capfd.readouterr().err
    for words, said in (
        (["simulate", "heap"], '"heap" is no file and no built-in scene (funnel, drop)'),
        (["simulate", "funel"], "(funnel, drop); did you mean funnel?"),
        (["generate", "funnel", "flat", "-n", "1", "-o", "x"], "no built-in prior (default)"),
        (["calibrate", "heap", "default", "x.png", "-o", "x"], "no built-in scene (funnel, drop)"),
        (["calibrate", "funnel", "flat", "x.png", "-o", "x"], "no built-in prior (default)"),
    ):
        assert main(words) == 2
        assert said in capfd.readouterr().err, words


def test_a_folder_that_is_refused_is_left_empty(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """A scene.toml that nothing could read had stayed there."""
    good = (folder / "camera.toml").read_text()
    place, camera = tmp_path / "new", tmp_path / "camera.toml"
    words = ["init", str(place), "--recording", str(folder / "couscous.png")]
    words += ["--camera", str(camera)]
    for unit, scene, said in (
        ("0.00001", "funnel", r"0.04 m from the camera, .* the funnel's tip at 0.12 m .* 1e-05 m"),
        ("0.00001", "drop", r"is 0.04 m from the camera, .* at 0.1 m \(start.height\): .* unit"),
        ("0.00000001", "funnel", "is 0 m from the camera, .* is the depth unit right"),
    ):
        camera.write_text(good.replace("depth_unit = 0.0001", f"depth_unit = {unit}"))
        assert main([*words, "--scene", scene]) == 2
        assert re.search(said, capfd.readouterr().err)
        assert not place.exists()
    # Who pours from that low is believed, and so is a camera of one's own.
    camera.write_text(good.replace("depth_unit = 0.0001", "depth_unit = 0.00001"))
    assert main([*words, "--set", "funnel.height=0.02"]) == 0
    for wrong in ("grains.count=1.5", "grains.counts=3", "camera.pixels=0"):
        assert main(["init", str(tmp_path / "wrong"), "--set", wrong]) == 2
        assert not (tmp_path / "wrong").exists()
