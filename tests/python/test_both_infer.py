"""`granulcal infer` and `granulcal-cli infer`: one answer, and Python's library says the same."""

import contextlib
import json
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import granulcal as gc
from granulcal import _native, cli
from granulcal.bayessim import BayesSim
from granulcal.bayessim.check.identifiability import Identifiability
from granulcal.errors import DoubtfulRecordingWarning

FIELDS = {
    "recordings", "parameters", "inside_model", "identifiability", "calibrated", "warnings",
    "statistics", "fixed",
}  # fmt: skip
OF_INSIDE = {
    "is_inside", "impossible", "p_value", "joint_p_value", "scatter_p_value", "statistics",
    "odd_pour",
}  # fmt: skip
SMALL: dict[str, Any] = {
    "features": 8,
    "ensemble": 2,
    "components": 2,
    "emulator_features": 8,
    "max_epochs": 15,
}


@pytest.fixture(scope="module")
def model(small_data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("both") / "model"
    made = BayesSim.fit(small_data, quiet=True, seed=1, **SMALL)
    made.save(folder)
    return folder, made


@pytest.fixture(scope="module")
def recording(small_scene, tmp_path_factory):
    return _poured(small_scene, tmp_path_factory.mktemp("recording"), seed=11)


@pytest.fixture(scope="module")
def second(small_scene, tmp_path_factory):
    """Another pour of the same material, by the same camera."""
    return _poured(small_scene, tmp_path_factory.mktemp("second"), seed=12)[0]


def _poured(small_scene, folder: Path, seed: int) -> list[str]:
    pour = gc.simulate(
        small_scene,
        gc.Material(sliding_friction=0.5, rolling_friction=0.2, restitution=0.4),
        seed=seed,
    )
    camera = gc.Camera.overhead(
        height=small_scene.get("camera.height"),
        field_width=small_scene.get("camera.field_width"),
        pixels=int(small_scene.get("camera.pixels")),
    )
    image, toml = camera.record(pour.positions, pour.radii, folder)
    return [str(image), "--camera", str(toml)]


def said(capfd, code: int, words: list[str], *, native: bool = False) -> dict:
    found = _native.run_cli(["granulcal-cli", *words]) if native else cli.main(words)
    out, err = capfd.readouterr()
    assert found == code, err
    return json.loads(out)


def both(capfd, code: int, words: list[str]) -> dict:
    """What both commands print, which is one object to the last field."""
    ours, theirs = said(capfd, code, words), said(capfd, code, words, native=True)
    assert ours == theirs and set(ours) == FIELDS
    assert set(ours["inside_model"]) == OF_INSIDE
    return ours


def _again(image: str, folder: Path) -> str:
    """A copy of a recording under another name."""
    return str(shutil.copy(image, folder / "again.png"))


def test_a_recording_given_twice_is_refused(model, recording, second, tmp_path, capfd):
    words = ["infer", str(model[0]), recording[0], *recording]
    assert cli.main(words) == 2
    assert "given once" in capfd.readouterr().err
    # A copy under another name is the same pour.
    words = ["infer", str(model[0]), _again(recording[0], tmp_path), second, *recording]
    assert cli.main(words) == 2
    assert "recordings 1 and 3 show one formation" in capfd.readouterr().err


def test_depths_in_too_small_a_unit_are_told_where_they_show_no_grains(
    model, recording, tmp_path, capfd
):
    """Where a pixel is off `needs at least 3 points` was all that was said."""
    pil = pytest.importorskip("PIL.Image")
    image, _, camera = recording
    text = Path(camera).read_text()
    unit = float(text.partition("depth_unit = ")[2].split()[0])
    small = text.replace(f"depth_unit = {unit}", f"depth_unit = {unit / 10}")
    (tmp_path / "small.toml").write_text(small)
    counts = np.asarray(pil.open(image)).copy()
    # In that unit the image is 9 by 9 squares of the scene's own pixels: one of them.
    side = len(counts) // 9
    counts[3 * side : 4 * side, 3 * side : 4 * side] -= round(4e-3 / (unit / 10))
    pil.fromarray(counts).save(tmp_path / "off.png")
    words = ["infer", str(model[0]), str(tmp_path / "off.png")]
    assert cli.main([*words, "--camera", str(tmp_path / "small.toml")]) == 2
    told = capfd.readouterr().err
    assert "at least 3 points" in told and "is the unit of the depths right" in told


@pytest.mark.parametrize("pours", [1, 2])
def test_both_commands_print_and_write_the_same_json(
    model, recording, second, pours, tmp_path, capfd
):
    images = [recording[0], second][:pours]
    words = ["infer", str(model[0]), *images, *recording[1:], "--json"]
    code = 0 if _is_inside(model[1], recording, *images[1:]) else 3
    found = both(capfd, code, words)
    assert len(found["statistics"]) == len(found["recordings"]) == pours
    for values in found["parameters"].values():
        assert set(values) == {"mode", "mean", "median", "interval90"}
    for name, native in (("ours", False), ("theirs", True)):
        said(capfd, code, [*words, "-o", str(tmp_path / f"{name}.json")], native=native)
    ours, theirs = (json.loads((tmp_path / f"{n}.json").read_text()) for n in ("ours", "theirs"))
    assert ours == theirs and len(ours.pop("samples")) == 1000 and ours == found
    words += ["--samples", "7", "--seed", "3"]
    ours, theirs = said(capfd, code, words), said(capfd, code, words, native=True)
    assert ours == theirs and np.shape(ours["samples"]) == (7, len(found["parameters"]))


def test_rust_says_what_python_says(model, recording, capfd):
    folder, made = model
    x = _statistics(made, recording)
    code = 0 if _is_inside(made, recording) else 3
    found = said(capfd, code, ["infer", str(folder), *recording, "--json"])
    assert found["statistics"][0] == pytest.approx(dict(zip(made.x_names, x, strict=True)))
    misfit, posterior = made.misfit(x), made.posterior(x)
    inside = found["inside_model"]
    # One pour is compared with kept residuals: no draw is random.
    assert inside["p_value"] == pytest.approx(misfit.p_value, abs=1e-9)
    assert inside["joint_p_value"] == pytest.approx(misfit.joint_p_value, abs=1e-9)
    for each in misfit.statistics:
        assert inside["statistics"][each.name]["residual"] == pytest.approx(each.residual, abs=1e-5)
    assert inside["is_inside"] == misfit.is_inside
    spread = posterior.sample(2000, seed=1).std(axis=0)
    mode, known = posterior.mode(), Identifiability.of(posterior)
    for i, name in enumerate(posterior.names):
        values = found["parameters"][name]
        assert abs(values["mean"] - posterior.mean()[i]) < 0.1 * spread[i]
        assert abs(values["mode"] - mode[i]) < 0.25 * spread[i]
    # Gains are of a thousand random draws each.
    assert np.allclose(found["identifiability"]["gains"], known.gains, atol=0.12)
    dimension = found["identifiability"]["effective_dimension"]
    assert dimension == pytest.approx(known.effective_dimension, abs=0.25)


def test_several_pours_of_a_network_count_as_one_in_both(
    small_data, recording, second, tmp_path, capfd
):
    made = BayesSim.fit(small_data, quiet=True, seed=2, method="mdrff", **SMALL)
    made.save(tmp_path / "m")
    x = np.array([_statistics(made, [image, *recording[1:]]) for image in (recording[0], second)])
    words = ["infer", str(tmp_path / "m"), recording[0], second, *recording[1:], "--json"]
    code = 0 if made.misfit(x).is_inside else 3
    found = both(capfd, code, words)
    posterior = made.posterior(x)
    spread = posterior.sample(2000, seed=1).std(axis=0)
    for i, name in enumerate(posterior.names):
        assert abs(found["parameters"][name]["mean"] - posterior.mean()[i]) < 0.25 * spread[i]


def test_a_model_of_some_of_the_statistics_takes_those_by_name(
    small_data, recording, tmp_path, capfd
):
    chosen = ["sd_r", "max_z", "iqr_y", "mean_r"]
    columns = [small_data.x_names.index(name) for name in chosen]
    usable = small_data.is_usable
    made = BayesSim.fit(
        small_data.theta[usable],
        small_data.x[usable][:, columns],
        prior=small_data.prior,
        x_names=chosen,
        scene=small_data.scene,
        quiet=True,
        method="mdrff",
        **SMALL,
    )
    made.save(tmp_path / "m")
    opened = gc.Recording.open(recording[0], camera=recording[2])
    seen = opened.formation(**small_data.scene.reading).statistics()
    misfit = made.misfit(seen)
    assert np.array_equal(made.posterior(seen).mean(), made.posterior(seen.to_dict()).mean())
    words = ["infer", str(tmp_path / "m"), *recording, "--json"]
    found = both(capfd, 0 if misfit.is_inside else 3, words)
    told = found["statistics"][0]
    assert told == pytest.approx({name: seen[name] for name in chosen})
    assert found["inside_model"]["p_value"] == pytest.approx(misfit.p_value, abs=1e-9)


def test_what_is_outside_is_said_with_exit_code_3(model, small_scene, tmp_path, capfd):
    # A room: a floor with boxes of half a metre, seen from two metres.
    camera = gc.Camera.overhead(height=2.0, field_width=2.0, pixels=160)
    generator = np.random.default_rng(0)
    boxes = np.c_[generator.uniform(-0.6, 0.6, (12, 2)), np.full(12, 0.25)]
    image, toml = camera.record(boxes, np.full(12, 0.25), tmp_path)
    words = ["infer", str(model[0]), str(image), "--camera", str(toml), "--json"]
    found = both(capfd, 3, words)
    inside = found["inside_model"]
    assert inside["is_inside"] is False and found["parameters"] is None
    assert any("height" in reason for reason in inside["impossible"])
    assert cli.main(words[:-1]) == 3
    out = capfd.readouterr().out
    assert "OUTSIDE THE MODEL" in out
    # It may be one of these that is wrong.
    count = small_scene.get("grains.count")
    assert out.splitlines()[-1].startswith(f"assumed: grains.count {count:g}, ")


def test_pixels_at_the_edge_are_told_before_a_map_is_refused(model, tmp_path, capfd):
    # A mound of 12 mm on a flat bed, and three dead columns 20 cm high.
    edge = np.linspace(-1, 1, 60)
    mound = 0.012 * np.maximum(0.0, 1 - 9 * (edge[:, None] ** 2 + edge[None] ** 2))
    mound[:, :3] = 0.2
    path = tmp_path / "map.npz"
    np.savez(path, depthmap=1e3 * mound, xres=3.4, yres=3.4, zres=1.0, scale="mm")
    words = ["infer", str(model[0]), str(path), "--json"]
    assert cli.main(words) == 3
    out, err = capfd.readouterr()
    assert json.loads(out)["inside_model"]["impossible"]
    told = re.search(r"pixels at the edge of the image.* --border (\d+) leaves them out", err)
    assert told is not None, err
    assert cli.main([*words, "--border", told[1]]) in (0, 3)
    assert "at the edge" not in capfd.readouterr().err


def _statistics(model: BayesSim, recording: list[str]) -> np.ndarray:
    reading = gc.Scene.from_toml(model.scene_toml or "").reading
    opened = gc.Recording.open(recording[0], camera=recording[2])
    return np.asarray(opened.formation(**reading).statistics())


def _is_inside(model: BayesSim, recording: list[str], *more: str) -> bool:
    images = (recording[0], *more)
    seen = [_statistics(model, [image, *recording[1:]]) for image in images]
    return model.misfit(np.array(seen)).is_inside


def test_report_and_calibrate_say_what_is_outside_too(model, small_scene, tmp_path, capfd):
    folder, _ = model
    data = tmp_path / "pours.parquet"
    scene, prior = tmp_path / "scene.toml", tmp_path / "prior.toml"
    made = BayesSim.load(folder)
    scene.write_text(small_scene.to_toml())
    prior.write_text(made.prior.to_toml())
    gc.generate(small_scene, made.prior, 3, seed=5, out=tmp_path / "few", progress=False).save(data)
    # A room, as above, and a pile of three times as many grains, which could be of the scene.
    room = _recorded(tmp_path / "room", height=2.0, field_width=2.0, pixels=160, seed=0)
    report = ["report", str(folder), *room, "--data", str(data), "-o", str(tmp_path / "r.html")]
    code = cli.main(report)
    out = capfd.readouterr().out
    assert code == 3 and "OUTSIDE THE MODEL" in out and "height" in out
    assert not (tmp_path / "r.html").exists()
    found = said(capfd, 3, [*report, "--json"])
    assert found["inside_model"]["is_inside"] is False and found["parameters"] is None
    run = ["calibrate", str(scene), str(prior), *room, "-o", str(tmp_path / "run"), "--json"]
    found = said(capfd, 3, run)
    assert found["inside_model"]["is_inside"] is False and found["parameters"] is None
    assert any("height" in reason for reason in found["inside_model"]["impossible"])
    # Nothing was poured for it.
    assert not (tmp_path / "run").exists()


def test_calibrate_refuses_a_copy_of_a_recording_before_it_pours(
    model, small_scene, recording, tmp_path, capfd
):
    scene, prior = tmp_path / "scene.toml", tmp_path / "prior.toml"
    scene.write_text(small_scene.to_toml())
    prior.write_text(model[1].prior.to_toml())
    images = [recording[0], _again(recording[0], tmp_path)]
    words = ["calibrate", str(scene), str(prior), *images, *recording[1:]]
    assert cli.main([*words, "-o", str(tmp_path / "run")]) == 2
    assert "recordings 1 and 2 show one formation" in capfd.readouterr().err
    assert not (tmp_path / "run").exists()


def test_calibrate_tells_what_makes_a_recording_doubtful(
    model, small_scene, tmp_path, capfd, monkeypatch
):
    scene, prior = tmp_path / "scene.toml", tmp_path / "prior.toml"
    scene.write_text(small_scene.to_toml())
    prior.write_text(model[1].prior.to_toml())
    # Half of the grains lie beyond the image's edge.
    field, pour = small_scene.get("camera.field_width"), gc.simulate(small_scene, seed=11)
    camera = gc.Camera.overhead(
        height=small_scene.get("camera.height"),
        field_width=field,
        pixels=int(small_scene.get("camera.pixels")),
    )
    image, toml = camera.record(
        pour.positions + np.array([0.5 * field, 0, 0]), pour.radii, tmp_path
    )

    def stopped(*_: Any, **__: Any) -> None:
        raise ValueError("no pours here")

    monkeypatch.setattr("granulcal.within_budget.calibrate_within", stopped)
    words = ["calibrate", str(scene), str(prior), str(image), "--camera", str(toml)]
    assert cli.main([*words, "-o", str(tmp_path / "run")]) == 2
    err = capfd.readouterr().err
    assert f"warning: {image}: " in err and "the others are out of view" in err


def test_calibrate_asks_about_a_funnel_above_the_camera_before_it_pours(
    tmp_path, capfd, monkeypatch
):
    """As with a height in another unit: pours had been made from 12 m, and were out of view."""
    poured = gc.Scene.funnel(height=0.05).with_({"grains.count": 60}, preset="fast")
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=240)
    pour = gc.simulate(poured, seed=1)
    image, toml = camera.record(pour.positions, pour.radii, tmp_path)
    scene, prior = poured.with_({"funnel.height": 12.0}), gc.Prior.default()
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    (tmp_path / "prior.toml").write_text(prior.to_toml())
    twice = [gc.Recording.open(image, camera=toml)] * 2
    with (
        pytest.warns(DoubtfulRecordingWarning) as told,
        pytest.raises(ValueError, match="one form"),
    ):
        gc.calibrate_within(scene, prior, twice, out=tmp_path / "run")
    asked = "the scene: the funnel's tip (funnel.height = 12 m) is above the camera"
    assert any(asked in str(each.message) for each in told)

    def stopped(*_: Any, **__: Any) -> None:
        raise ValueError("no pours here")

    monkeypatch.setattr("granulcal.within_budget.calibrate_within", stopped)
    words = ["calibrate", *(str(tmp_path / name) for name in ("scene.toml", "prior.toml"))]
    words += [str(image), "--camera", str(toml), "-o", str(tmp_path / "run")]
    assert cli.main(words) == 2
    assert f"warning: {asked}" in capfd.readouterr().err


def test_a_pile_that_no_material_explains_is_outside_for_report_and_calibrate(
    model, small_scene, small_data, tmp_path, capfd
):
    folder, made = model
    many = small_scene.with_({"grains.count": 170})
    pour = gc.simulate(
        many, gc.Material(sliding_friction=0.9, rolling_friction=0.4, restitution=0.1), seed=1
    )
    camera = gc.Camera.overhead(
        height=small_scene.get("camera.height"),
        field_width=small_scene.get("camera.field_width"),
        pixels=int(small_scene.get("camera.pixels")),
    )
    image, toml = camera.record(pour.positions, pour.radii, tmp_path / "pile")
    recording = [str(image), "--camera", str(toml)]
    assert not _is_inside(made, recording)
    found = both(capfd, 3, ["infer", str(folder), *recording, "--json"])
    assert found["inside_model"]["p_value"] is not None and found["parameters"] is not None
    data = tmp_path / "pours.parquet"
    small_data.save(data)
    page = tmp_path / "r.html"
    words = [
        "report",
        str(folder),
        *recording,
        "--data",
        str(data),
        "--seeds",
        "1",
        "-o",
        str(page),
    ]
    assert cli.main(words) == 3
    told = capfd.readouterr()
    assert "OUTSIDE THE MODEL" in told.out and page.exists() and "another prior" not in told.err
    # Pours of another prior are told, and are not what the model was trained on.
    narrow = made.prior.to_toml().replace("low = 0.2\n", "low = 0.25\n", 1)
    others = gc.generate(
        small_scene, gc.Prior.from_toml(narrow), 30, seed=6, out=tmp_path / "30", progress=False
    )
    data.unlink()
    others.save(data)
    assert cli.main([*words, "--json"]) == 3
    captured = capfd.readouterr()
    found = json.loads(captured.out)
    differs = "material.sliding_friction is uniform from 0.25 to 1 there and uniform from 0.2 to 1"
    assert differs in captured.err and any(differs in each for each in found["warnings"])
    text = page.read_text(encoding="utf-8")
    assert differs in text and f"a model trained on {len(small_data)} pours" in text
    scene, prior = tmp_path / "scene.toml", tmp_path / "prior.toml"
    scene.write_text(small_scene.to_toml())
    prior.write_text(made.prior.to_toml())
    run = ["calibrate", str(scene), str(prior), *recording, "--budget", "60", "--json"]
    found = said(capfd, 3, [*run, "-o", str(tmp_path / "run")])
    assert found["inside_model"]["is_inside"] is False and found["parameters"] is not None
    assert set(found["left_out"]) == {"unhealthy", "jammed", "no_grains_in_view", "unseen"}


def _recorded(folder, *, height: float, field_width: float, pixels: int, seed: int) -> list[str]:
    """Boxes of half a metre on a floor, as a recording."""
    camera = gc.Camera.overhead(height=height, field_width=field_width, pixels=pixels)
    generator = np.random.default_rng(seed)
    boxes = np.c_[generator.uniform(-0.6, 0.6, (12, 2)), np.full(12, 0.25)]
    image, toml = camera.record(boxes, np.full(12, 0.25), folder)
    return [str(image), "--camera", str(toml)]


@pytest.mark.parametrize("word", ["infer", "calibrate", "report"])
def test_who_has_frames_as_images_is_told_that_they_are_one_recording(word, capfd):
    """One by one they count as pours: no check knows frames of one from pours of one material."""
    with contextlib.suppress(SystemExit):
        cli.main([word, "--help"])
    told = " ".join(capfd.readouterr().out.split())
    assert "each another pour (PNGs of one are a folder)" in told
