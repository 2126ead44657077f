"""What the loop asks of its recordings before it pours, and what it fixes of them."""

import argparse
import json
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import granulcal as gc
from granulcal.commands.close_loop import _command
from granulcal.errors import ObservationError
from granulcal.loop.check.by_pours import ByPours
from granulcal.loop.check.standing import stand
from granulcal.loop.condition import Condition
from granulcal.loop.effects.library import by_name
from granulcal.loop.pours.archive import ArchivePlan
from granulcal.loop.pours.measures import Measures
from granulcal.loop.preregistration import register
from granulcal.loop.recorded import _missing_share, doubt_of_start, require_no_copies
from granulcal.loop.report.page import sentence_of
from granulcal.loop.task import Task
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import Verdict
from granulcal.report import template

PRIOR = """
[[parameter]]
path = "material.sliding_friction"
distribution = "uniform"
low = 0.2
high = 0.8
"""


@pytest.fixture(scope="module")
def scene() -> gc.Scene:
    camera = {"camera.field_width": 0.2, "camera.pixels": 200, "camera.downsample": 1}
    return gc.Scene.drop(0.02, count=60).with_({"camera.height": 0.3, **camera})


@pytest.fixture(scope="module")
def recorded(scene: gc.Scene, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three pours as images, all of one camera."""
    folder = tmp_path_factory.mktemp("recorded")
    camera = gc.Camera.overhead(height=0.3, field_width=0.2, pixels=200)
    found = []
    for seed in range(3):
        pour = gc.simulate(scene, seed=seed)
        image, toml = camera.record(pour.positions, pour.radii, folder / str(seed))
        found.append(shutil.copy(image, folder / f"pour-{seed}.png"))
        shutil.copy(toml, folder / "camera.toml")
    return [Path(path) for path in found]


def test_a_recording_has_the_slope_of_its_pour(scene: gc.Scene, recorded: list[Path]) -> None:
    measures = Measures.of(scene)
    slope = measures.names.index("profile_slope")
    for seed, path in enumerate(recorded):
        of_pour = measures.of_pour(gc.simulate(scene, seed=seed))[slope]
        # By the spacing of its points, which stand nearer to the camera, it was 2 % off and more.
        found = measures.of_recording(path, scene, None)[slope]
        assert found == pytest.approx(of_pour, rel=5e-3)


def task_of(scene: gc.Scene, images: list[Path], **condition: Any) -> Task:
    at = {"start.height": scene.get("start.height")}
    one = Condition("here", at, "fit", tuple(images), **condition)
    prior = gc.Prior.from_toml(PRIOR)
    return Task(scene=scene, prior=prior, conditions=(one,), library=by_name(["tilt.y"]))


def registered(task: Task, folder: Path) -> str:
    plan = ArchivePlan(
        scene=task.scene, prior=task.prior, conditions=(), library=task.library, base=4, each=4
    )
    return register(folder, task, plan, Thresholds(), 0, ("max_z",))


def test_cameras_colours_and_what_is_known_are_fixed(
    scene: gc.Scene, recorded: list[Path], tmp_path: Path
) -> None:
    folder = tmp_path / "pours"
    shutil.copytree(recorded[0].parent, folder)
    images, camera = [folder / path.name for path in recorded], folder / "camera.toml"
    task, out = task_of(scene, images), tmp_path / "out"
    out.mkdir()
    first = registered(task, out)
    assert registered(task, out) == first
    text = camera.read_text()

    def refused(changed: Task) -> None:
        with pytest.raises(ObservationError, match=r"another analysis \(conditions differ\)"):
            registered(changed, out)

    # Another lens beside the images, a camera of one image alone, and one that is given.
    camera.write_text(text.replace("fx = ", "fx = 1"))
    refused(task)
    camera.write_text(text)
    assert registered(task, out) == first
    # The same of depths that are no picture.
    depths, of_depths = [image.with_suffix(".npy") for image in images], tmp_path / "of_depths"
    for image, path in zip(images, depths, strict=True):
        np.save(path, np.asarray(gc.Recording.open(image).depth))
    of_depths.mkdir()
    registered(task_of(scene, depths), of_depths)
    camera.write_text(text.replace("fx = ", "fx = 1"))
    with pytest.raises(ObservationError, match="conditions differ"):
        registered(task_of(scene, depths), of_depths)
    camera.write_text(text)
    own = images[0].with_suffix(".toml")
    own.write_text(text + "\n")
    refused(task)
    own.unlink()
    given = tmp_path / "given.toml"
    given.write_text(text + "\n")
    refused(task_of(scene, images, camera=given))
    refused(task_of(scene, images, known={"effects.tilt.y": 0.01}))
    # And the colour image that the camera names.
    colour = tmp_path / "colour.png"
    colour.write_bytes(b"one")
    given.write_text('colour = "colour.png"\n' + text)
    task, out = task_of(scene, images, camera=given), tmp_path / "coloured"
    out.mkdir()
    registered(task, out)
    colour.write_bytes(b"another")
    refused(task)


def test_a_registration_of_before_stays(
    scene: gc.Scene, recorded: list[Path], tmp_path: Path
) -> None:
    task = task_of(scene, recorded)
    new = registered(task, tmp_path)
    path = tmp_path / "preregistration.json"
    document = json.loads(path.read_text())
    cameras = document["conditions"][0].pop("cameras")
    assert len(cameras) == 3 and len(set(cameras)) == 1 and cameras[0].startswith("camera.toml ")
    path.write_text(json.dumps(document, indent=1) + "\n")
    old = registered(task, tmp_path)
    assert old != new and "cameras" not in path.read_text()
    with pytest.raises(ObservationError, match=r"another analysis \(conditions differ\)"):
        registered(task_of(scene, recorded[::-1]), tmp_path)


def test_a_copy_under_another_name_is_refused(recorded: list[Path], tmp_path: Path) -> None:
    copy = Path(shutil.copy(recorded[0], tmp_path / "copy.png"))
    one = Condition("one", {}, "fit", tuple(recorded[:2]))
    other = Condition("other", {}, "sealed", (copy,))
    none = [np.empty((2, 0)), np.empty((1, 0))]
    with pytest.raises(ObservationError, match=r"pour-0.png of 'one' and .*copy.png of 'other'"):
        require_no_copies((one, other), [row[:0] for row in none])
    # Two curves of one file are not one pour.
    read = [replace(c, reading={"series": c.name}) for c in (one, other)]
    require_no_copies(read, [row[:0] for row in none])
    # Another file that shows the same, to the last digit.
    rows = [np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[1.0, 2.0]])]
    third = replace(other, recordings=(recorded[2],))
    with pytest.raises(ObservationError, match="the same statistics, to the last digit"):
        require_no_copies((one, third), rows)
    rows[1][0, 1] += 1e-12
    require_no_copies((one, third), rows)


def test_recordings_are_asked_whether_they_can_be_of_the_scene(
    scene: gc.Scene, recorded: list[Path], tmp_path: Path
) -> None:
    assert task_of(scene, recorded).require_readable() == ()
    with pytest.raises(ObservationError, match="the same bytes: each pour counts once"):
        again = Path(shutil.copy(recorded[0], tmp_path / "again.png"))
        shutil.copy(recorded[0].parent / "camera.toml", tmp_path)
        task_of(scene, [*recorded, again]).require_readable()
    # A grain higher than the scene's can come to lie; the volume fits.
    camera = gc.Camera.overhead(height=0.6, field_width=0.4, pixels=400)
    places = np.stack(np.meshgrid(*[np.linspace(-0.1, 0.1, 8)] * 2), axis=-1).reshape(-1, 2)
    spheres = np.c_[places, np.full(64, 2e-3)]
    spheres[:8, 2] = 0.12
    image, toml = camera.record(spheres, np.full(64, 2e-3), tmp_path / "high")
    with pytest.raises(ObservationError, match=r"height .*no formation of the scene under 'here'"):
        task_of(scene, [Path(image)], camera=Path(toml), averaged=True).require_readable()
    # Half of the grains beyond the image's edge are told.
    pour = gc.simulate(scene, seed=7)
    camera = gc.Camera.overhead(height=0.3, field_width=0.2, pixels=200)
    image, toml = camera.record(
        pour.positions + np.array([0.1, 0, 0]), pour.radii, tmp_path / "half"
    )
    doubts = task_of(scene, [Path(image)], camera=Path(toml), averaged=True).require_readable()
    assert any("the others are out of view" in doubt for doubt in doubts)
    assert all(str(image) in doubt for doubt in doubts)


def test_no_recording_is_opened_more_often_than_another(
    scene: gc.Scene, recorded: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened, plain = Counter[Path](), gc.Recording.open

    def counted(path: Path, **settings: Any) -> gc.Recording:
        opened[path] += 1
        return plain(path, **settings)

    monkeypatch.setattr(gc.Recording, "open", counted)
    # The first of a condition is asked for its ground, too.
    task_of(scene, recorded).require_readable()
    assert opened == dict.fromkeys(recorded, 2)


def test_a_map_a_funnel_above_the_camera_and_pixels_without_data_are_told(
    scene: gc.Scene, recorded: list[Path], tmp_path: Path
) -> None:
    image = pytest.importorskip("PIL.Image")
    # Every fortieth pixel has no data.
    shutil.copy(recorded[0].parent / "camera.toml", tmp_path)
    for number, path in enumerate(recorded):
        depth = np.asarray(image.open(path)).astype(np.uint16)
        holes = np.random.default_rng(number).random(depth.shape) < 0.025
        image.fromarray(np.where(holes, 0, depth).astype(np.uint16)).save(
            tmp_path / f"{number}.png"
        )
    images = [tmp_path / f"{number}.png" for number in range(3)]
    told = task_of(scene, images).require_readable()
    (doubt,) = told
    assert "here: up to 2" in doubt and "% of the pixels about the formation have no" in doubt
    # A rim of the levelled image that the camera did not see is no hole of it.
    heights = np.full((20, 30), 0.01)
    heights[:, -1], heights[:3, 0], heights[-2:, :] = np.nan, np.nan, np.nan
    seen = SimpleNamespace(heights=heights, mask=np.isfinite(heights))
    seen.mask[5, -1] = seen.mask[-1, 4] = True
    assert _missing_share(cast(Any, seen)) == 0.0
    heights[7, 8:10] = np.nan
    assert _missing_share(cast(Any, seen)) == pytest.approx(2 / (18 * 29 - 3))
    # A map does not know where the axis was.
    from_far = scene.to_toml().replace('"pinhole"', '"orthographic"')
    pour = gc.simulate(gc.Scene.from_toml(from_far), seed=9)
    heights, wide = 1e3 * pour.height_map(), 1e3 * scene.ground_resolution
    np.savez(tmp_path / "map.npz", depthmap=heights, xres=wide, yres=wide, zres=1.0, scale="mm")
    with pytest.raises(ObservationError, match="map.npz is a height map, which does not say where"):
        Measures.of(scene).of_recording(tmp_path / "map.npz", scene, None)
    # The depths are five per cent too large for where the scene has its camera.
    lower = {"camera.height": 0.2857}
    (doubt,) = task_of(scene.with_(lower), recorded).require_readable()
    assert "the ground lies 0.3 m from the camera, of the scene's" in doubt
    assert doubt.startswith("here: ") and "5 % too large" in doubt
    assert task_of(scene.with_({"camera.height": 0.297}), recorded).require_readable() == ()
    # Of one recording alone, which need not be the first.
    odd = tmp_path / "odd.npy"
    np.save(odd, 1.05 * np.asarray(gc.Recording.open(recorded[1]).depth))
    shutil.copy(recorded[1].parent / "camera.toml", tmp_path)
    among = [recorded[0], odd, recorded[2]]
    (doubt,) = task_of(scene, among).require_readable()
    assert doubt.startswith(f"here: the ground of {odd} (0.315 m) is not as far from the camera")
    # More than three times as far off a recording asks for the unit, and nothing says it again.
    for height, is_told_of_unit in ((0.102, False), (0.098, True)):
        told = task_of(scene.with_({"camera.height": height}), recorded).require_readable()
        of_ground = [doubt for doubt in told if "the ground " in doubt and "camera.height" in doubt]
        of_unit = [doubt for doubt in of_ground if "is the unit of the depths right" in doubt]
        assert len(of_ground) == (len(recorded) if is_told_of_unit else 1)
        assert of_unit == (of_ground if is_told_of_unit else [])
    # Two metres in place of two centimetres.
    hung = gc.Scene.funnel(0.02).with_({"funnel.height": 2.0, "camera.height": 0.3})
    assert (
        "(funnel.height = 2 m) is above the camera (camera.height = 0.3 m)"
        in (doubt_of_start("2 cm", hung)[0])
    )
    assert doubt_of_start("2 cm", hung.with_({"funnel.height": 0.02})) == []
    dropped = gc.Scene.drop(50).with_({"start.height": 3.0, "camera.height": 0.4})
    (told,) = doubt_of_start("3 cm", dropped)
    assert "lowest point (start.height = 3 m) is above the camera (camera.height = 0.4 m)" in told
    assert doubt_of_start("3 cm", dropped.with_({"start.height": 0.03})) == []


def test_a_none_by_the_base_models_own_pours_shows_the_p_that_decided() -> None:
    fits = Verdict("EFFECT", ("drag",), ("drag",), 0.002, "")
    of_base = cast(Any, SimpleNamespace(residual_test=SimpleNamespace(p=0.3), to_dict=dict))
    found = stand(fits, Thresholds(), confirmed=0.5, of_base=of_base)
    assert (found.verdict.kind, found.verdict.p, found.surrogate_p) == ("NONE", 0.3, 0.002)
    assert found.to_dict()["p_before_checks"] == 0.002
    assert "no residual was found" not in sentence_of(found)
    for names, said in (
        (("camera.y",), "Of what was tried it is not the grains"),
        (("camera.y", "drag"), "The grains do"),
    ):
        seen = stand(replace(fits, named=names, p=1e-4), Thresholds(), confirmed=0.5)
        assert sentence_of(seen).startswith(said)
    none = stand(replace(fits, kind="NONE", named=(), p=0.3), Thresholds(), confirmed=0.5)
    assert none.surrogate_p is None and "no residual was found" in sentence_of(none)


def page(**values: Any) -> str:
    """The page with nothing on it but `values`."""
    filled: dict[str, Any] = dict.fromkeys(
        ("totals", "errors", "told", "corrections", "strengths", "rivals", "hidden", "experiments"),
        (),
    )
    words = dict.fromkeys(
        ("title", "headline", "sentence", "reason", "made", "version", "residuals", "pictures"), ""
    )
    words |= dict.fromkeys(("picture_of", "command"), "")
    filled |= {"is_named": True, "word": "EFFECT"}
    lists = dict.fromkeys(("nearest", "beyond", "doubts", "held", "untried"), ())
    standing = SimpleNamespace(
        trivial=(), moved=(), draws=0, anchors=0, confirmed=0.5, weighed=values.pop("weighed", ())
    )
    placebo = SimpleNamespace(kind="NONE", p=0.5)
    return template("loop.html.j2").render(
        **{**filled, **words, **lists, "standing": standing, "placebo": placebo, "pours": 0}
        | {"registration": "0" * 64, "parameters": {}, "number": "{:.3g}".format, "p": 0.3}
        | {"surrogate_p": None, "calibrated": None, **values}
    )


def test_the_page_says_what_is_beyond_doubtful_and_which_p_decided() -> None:
    plain = page()
    assert "p of the residual of the base model" in plain
    assert "comes near" not in plain and "Doubts" not in plain
    found = page(surrogate_p=0.002, beyond=("max_z at low: 4",), doubts=("a.png: a heap",))
    assert "by the surrogate alone 0.002" in found
    assert "<li>max_z at low: 4</li>" in found and "<li>a.png: a heap</li>" in found
    assert "Not tried" not in plain and "name them: clump, bonds." in page(
        untried=["clump", "bonds"]
    )
    rivals = [ByPours(("clump",), -3.0, 0.4), ByPours(("camera.blur",), -15.5, 0.01)]
    assert "own pours" not in plain
    told = page(weighed=rivals).replace("\n", " ")
    assert "clump, whose pours leave what has p = 0.4; camera.blur 12.5 nat less, whose" in told
    row = SimpleNamespace(label="low", before=2.0, after=1.0, refused="")
    assert "may repeat what the\nparameters could have done" in page(corrections=(row,))


def test_a_candidate_that_is_not_named_is_not_the_effect() -> None:
    row = dict(name="tilt.x", path="effects.tilt.x", unit="rad", doc="", is_mimicked=False)
    strengths = [row | dict(low=0.01, middle=0.02, high=0.03)]
    named = page(strengths=strengths, held=(54, 63))
    assert "<h2>The effect</h2>" in named and "not named" not in named
    faint = page(strengths=strengths, held=(54, 63), is_named=False, word="RESIDUAL")
    assert "<h2>The effect</h2>" not in faint and "candidate, not named" in faint
    assert "The verdict is RESIDUAL and names nothing" in faint and "Consistent with" not in faint
    # Errors after are with the candidate, whatever the word.
    assert "After is with the most probable candidate" in faint and "After is with" not in named
    assert "Linear, hence" not in faint


def test_both_floors_and_whose_interval_it_is_are_on_the_page() -> None:
    one, two = (
        SimpleNamespace(error=3.0, floor=floor, square=1.0, interval=(0.5, 1.5))
        for floor in (1.25, 2.75)
    )
    shown = page(errors=[dict(label="low", use="fit", before=one, after=two)])
    assert "<td>1.25</td><td>2.75</td>" in shown and "95 % of D² after" in shown


def test_a_zero_is_in_the_command_of_the_page() -> None:
    given = {"archive": None, "tolerances": None, "engine": None, "out": Path("out")}
    options = argparse.Namespace(**given, pairs=0, rounds=0, budget=900, seed=0)
    assert _command(options, Path("loop.toml")) == (
        "granulcal close-loop loop.toml -o out --pairs 0 --rounds 0 --budget 900 --seed 0"
    )
