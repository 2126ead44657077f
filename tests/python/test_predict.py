"""Which conditions `granulcal predict` takes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from two_heights import two_heights

import granulcal as gc
from granulcal.cli import main
from granulcal.errors import ObservationError
from granulcal.loop.check import discrepancy
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.asked import REACH
from granulcal.loop.report.models import Maker, Models, condition_of
from granulcal.loop.report.prediction import Prediction
from granulcal.loop.test.score import DISCREPANCY_LENGTH
from granulcal.pours.scene import Scene

NAME, OBSERVED = "radius[50]", "[observe.radius]\npercentiles = [50.0]\n"


@pytest.fixture
def models(tmp_path: Path) -> Models:
    """Measured from two heights."""
    scene = Scene.drop(0.02, count=12, preset="fast").to_toml()
    observing = Scene.from_toml(f"{scene}\n[observe]\nrate = 100.0\n{OBSERVED}")
    made = two_heights(observing, NAME)
    made.write(tmp_path)
    return made


@pytest.mark.parametrize(
    "word",
    ["a=nan", "a=inf", "a=-inf", "a=true", 'a="0.5"', "a=1e200", f"a={'9' * 400}", "a", "=1",
     "a=1\nb=2", "a=[1]"],
)  # fmt: skip
def test_a_condition_is_of_finite_numbers(word: str) -> None:
    with pytest.raises(ObservationError, match="its number finite; got"):
        condition_of([word])


def test_a_condition_states_each_path_once() -> None:
    with pytest.raises(ObservationError, match="each path once, got a twice"):
        condition_of(["a=1", "b=2", "a=1"])
    assert condition_of(["a=1e-3 # mine", "b=-2"]) == {"a": 1e-3, "b": -2.0}
    # As `--set` takes them.
    assert condition_of(["a=.05", "b=+1."]) == {"a": 0.05, "b": 1.0}


@pytest.mark.parametrize("model", ["line", "nearest", "corrected"])
def test_what_a_model_without_physics_would_ignore_is_refused(
    model: str, models: Models, tmp_path: Path
) -> None:
    at = {"start.height": 0.015, "grains.count": 500.0}
    forward = Forward(tmp_path / "pours", 1)
    with pytest.raises(ObservationError, match=f"{model} knows .* it would ignore grains.count"):
        models.predict(model, at, forward)
    # What the conditions share they state.
    shared = {"start.height": 0.015, "material.restitution": 0.5}
    if model != "corrected":
        assert models.predict(model, shared, forward).middle == pytest.approx([0.015], abs=0.006)


def test_python_is_told_what_the_command_line_is(
    models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = gc.predict(tmp_path, {"start.height": 0.03}, "base", pours=2, threads=1)
    words = ["predict", str(tmp_path), "--model", "base", "--pours", "2", "--threads", "1"]
    main([*words, "--at", "start.height=0.03", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["statistics"] == found.to_dict()["statistics"]
    assert tuple(told["warnings"]) == found.doubts != ()
    with pytest.raises(FileNotFoundError, match=r"models.json is not there"):
        gc.predict(tmp_path / "nothing", {})
    assert models.names == found.names


@pytest.mark.parametrize("model", ["line", "nearest"])
def test_a_model_without_physics_is_not_asked_far_away(
    model: str, models: Models, tmp_path: Path
) -> None:
    assert pytest.approx(discrepancy._REACH * DISCREPANCY_LENGTH) == REACH
    forward = Forward(tmp_path / "pours", 1)
    models.predict(model, {"start.height": 0.0224}, forward)
    for height in (0.0226, 0.0074, 5.0):
        with pytest.raises(ObservationError, match=f"{model} holds up to 0.25 .unit range."):
            models.predict(model, {"start.height": height}, forward)


@pytest.mark.parametrize("model", ["base", "named"])
def test_a_model_that_pours_warns_outside_of_what_was_measured(
    model: str, models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["predict", str(tmp_path), "--model", model, "--pours", "2", "--threads", "1"]
    words += ["--level", "0.3", "--at"]
    assert main([*words, "start.height=0.02"]) == 0
    assert "warning" not in capsys.readouterr().err
    assert main([*words, "start.height=0.025"]) == 0
    told = capsys.readouterr().err
    assert "warning: start.height = 0.025 is outside 0.01 to 0.02" in told


def test_json_has_no_nan(
    models: Models,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    row = np.array([np.nan])
    monkeypatch.setattr(
        Models, "predict", lambda *_, **__: Prediction("base", (NAME,), row, row, row + 1, 0.9)
    )
    assert main(["predict", str(tmp_path), "--at", "start.height=0.02", "--json"]) == 0
    found = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert found["statistics"][NAME] == {"middle": None, "low": None, "high": None}


def test_pours_are_as_many_as_an_interval_needs(
    models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["predict", str(tmp_path), "--at", "start.height=0.02", "--pours"]
    for count in ("-3", "0", "1"):
        assert main([*words, count]) == 2
        assert f"--pours: must be at least 2, got {count}" in capsys.readouterr().err
    with pytest.raises(ObservationError, match="base: pours must be at least 2, got 1"):
        models.predict("base", {"start.height": 0.02}, Forward(tmp_path, 1), pours=1)


@pytest.mark.parametrize("model", ["base", "named"])
def test_pours_that_cannot_be_used_are_told(model: str, models: Models, tmp_path: Path) -> None:
    class Jams(Forward):
        """Every second pour gives nothing."""

        def limit(self, scene, seeds, faults=None, coarse=None):
            rows = super().limit(scene, seeds, faults, coarse)
            return rows[[i for i, seed in enumerate(seeds) if seed % 2 == 0]]

    at, usual = {"start.height": 0.02}, Forward(tmp_path, 1)
    found = models.predict(model, at, Jams(tmp_path, 1), level=0.3, pours=6)
    assert found.pours == 3
    assert "3 of 6 pours under this condition jam" in found.doubts[0]
    assert not models.predict(model, at, usual, level=0.3, pours=6).doubts


def test_a_folder_may_be_named_by_a_word(models: Models, tmp_path: Path) -> None:
    assert Models.load(str(tmp_path)).names == models.names
    with pytest.raises(FileNotFoundError, match="is nowhere the -o of close-loop"):
        Models.load("nowhere")


def test_a_number_that_all_conditions_share_is_not_ignored(
    models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was taken, and the values of the shared number came back."""
    own = models.scene.get("material.restitution")
    shared = replace(models, shared={"material.restitution": own})
    forward = Forward(tmp_path / "pours", 1)
    for model in ("line", "nearest", "corrected"):
        at = {"start.height": 0.015, "material.restitution": own + 0.2}
        with pytest.raises(ObservationError, match=f"{model} knows no physics .*restitution = "):
            shared.predict(model, at, forward)
    shared.write(tmp_path)
    assert Models.load(tmp_path).shared == shared.shared
    words = ["predict", str(tmp_path), "--at", "start.height=0.015", "--pours", "2"]
    assert main([*words, "--at", f"material.restitution={own + 0.2}"]) == 0
    told = capsys.readouterr().err
    assert "outside the conditions of the loop: nothing was measured there" in told
    # A file of before does not say what is shared: its scene has it.
    document = json.loads((tmp_path / "models.json").read_text())
    del document["shared"], document["strengths"]
    (tmp_path / "models.json").write_text(json.dumps(document))
    assert Models.load(tmp_path).shared == shared.shared


def test_what_a_model_has_is_said_and_what_is_asked_for_in_its_place(
    models: Models, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    fitted = {"material.sliding_friction": 0.3}
    maker = Maker({**fitted, "effects.tilt.x": 0.05}, {}, {})
    faint = replace(
        models,
        verdict={"kind": "RESIDUAL", "named": []},
        makers={"base": (Maker(fitted, {}, {}),) * 2, "named": (maker,) * 2},
        strengths={"tilt.x": 0.55},
    )
    faint.write(tmp_path)
    words = ["predict", str(tmp_path), "--at", "start.height=0.015", "--pours", "2"]
    assert main(words) == 0
    told = capsys.readouterr()
    assert "with tilt.x, the most probable candidate, which the verdict does not name: " in told.out
    assert "effects.tilt.x = 0.05 at its fit" in told.out
    # Two pours have no ranks at 90 %.
    assert "2 usable pours are too few for ranks at 90 %" in told.err
    words += ["--at", "effects.tilt.x=0", "--at", "material.sliding_friction=0.5"]
    assert main([*words, "--json"]) == 0
    told = capsys.readouterr()
    assert "effects.tilt.x = 0 is not the 0.05 of the fit" in told.err
    found = json.loads(told.out)
    assert found["pours"] == 2 and len(found["warnings"]) == 3
    assert found["has"] == {
        "numbers": {"material.sliding_friction": 0.5, "effects.tilt.x": 0.0},
        "effects": {"effects.tilt.x": 0.05},
        "strengths": {"tilt.x": 0.55},
        "is_named": False,
    }
    assert main([*words[:6], "--model", "base"]) == 0
    assert "without any effect" in capsys.readouterr().out


@pytest.fixture
def inferred(tmp_path: Path) -> Path:
    """Returns a folder as calibrate leaves it."""
    names = ("material.sliding_friction", "material.rolling_friction")
    posterior = {
        "recordings": ["a.png"],
        "parameters": {name: {"mode": 0.4} for name in names},
        "samples": [[0.3, 0.3], [0.4, 0.4], [0.5, 0.35]],
        "fixed": {"material.restitution": 0.2},
    }
    (tmp_path / "posterior.json").write_text(json.dumps(posterior))
    scene = gc.Scene.drop(0.02, count=40, preset="fast")
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    return tmp_path


def test_a_posterior_predicts_by_pours_at_its_draws(
    inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--at", "start.height=0.03", "--pours", "4", "--threads", "1", "--json"]
    scene = str(inferred / "scene.toml")
    told = []
    for what in (inferred, inferred / "posterior.json"):
        assert main(["predict", str(what), scene, *words]) == 0
        told.append(json.loads(capsys.readouterr().out))
    assert told[0] == told[1] and told[0]["pours"] == 4 and told[0]["is_inside"] is True
    assert told[0]["units"]["max_z"] == "m"
    # The mean of pours at the draws, of what the prior fixed, under the condition.
    at = {"start.height": 0.03, "material.restitution": 0.2}
    rows = [
        gc.simulate(
            gc.Scene.load(scene).with_(
                at | {"material.sliding_friction": mu, "material.rolling_friction": rolling}
            ),
            seed=8_700_001 + i,
        ).statistics()["mean_r"]
        for i, (mu, rolling) in enumerate([(0.3, 0.3), (0.4, 0.4), (0.5, 0.35), (0.3, 0.3)])
    ]
    found = told[0]["statistics"]["mean_r"]
    assert found["middle"] == pytest.approx(np.mean(rows)) and found["low"] < min(rows)


def test_a_posterior_says_how_many_pours_jam(
    inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, file = inferred / "scene.toml", inferred / "funnel.toml"
    few = {"grains.count": 60, "funnel.height": 0.05}
    file.write_text(gc.Scene.funnel().with_(few, preset="fast").to_toml())
    words = ["--pours", "8", "--threads", "1", "--level", "0.3", "--json"]
    # Three grains wide: of some materials they bridge it.
    narrow = ["--at", "funnel.stem_radius=0.006", *words]
    assert main(["predict", str(inferred), str(file), *narrow]) == 0
    told = json.loads(capsys.readouterr().out)
    lost = 8 - told["pours"]
    assert 0 < lost < 8
    assert f"{lost} of 8 pours under this condition jam" in told["warnings"][0]
    # Where all can be used there is nothing to tell.
    assert main(["predict", str(inferred), str(scene), "--at", "start.height=0.03", *words]) == 0
    assert json.loads(capsys.readouterr().out)["warnings"] == []


def test_a_funnel_above_the_camera_is_told(
    inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = inferred / "funnel.toml"
    few = {"grains.count": 30, "end.horizon": 0.5}
    file.write_text(gc.Scene.funnel().with_(few, preset="fast").to_toml())
    words = ["--pours", "2", "--threads", "1", "--level", "0.3"]
    for height, is_told in (("0.05", False), ("0.3", True)):
        main(["predict", str(inferred), str(file), "--at", f"funnel.height={height}", *words])
        asked = "(camera.height = 0.29 m): is it in metres?" in capsys.readouterr().err
        assert asked is is_told, height


def test_a_height_in_millimetres_is_asked_for_where_no_pour_is_seen(
    inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It told that too few pours could be used, and nothing of the 70 m."""
    file = inferred / "funnel.toml"
    few = {"grains.count": 30, "end.horizon": 10.0}
    file.write_text(gc.Scene.funnel().with_(few, preset="fast").to_toml())
    words = ["--at", "funnel.height=120", "--pours", "2", "--threads", "1"]
    assert main(["predict", str(inferred), str(file), *words]) == 2
    told = capsys.readouterr().err
    assert "0 usable pours" in told and "funnel.height = 120 m" in told
    assert "is it in metres?" in told


def test_another_engine_than_the_material_was_inferred_with_is_told(
    inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = inferred / "posterior.json"
    words = ["predict", str(inferred), str(inferred / "scene.toml"), "--at", "start.height=0.03"]
    words += ["--pours", "2", "--threads", "1", "--json"]
    told = {}
    for engine in (None, "lammps"):
        file.write_text(json.dumps({**json.loads(file.read_text()), "engine": engine}))
        assert main(words) == 0
        told[engine] = json.loads(capsys.readouterr().out)["warnings"]
    assert not any("engine" in each for each in told[None])
    assert any("by pours of lammps, these are of granulcal" in each for each in told["lammps"])


def test_what_no_posterior_predicts_is_refused_by_name(
    inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, at = str(inferred / "scene.toml"), ["--at", "start.height=0.03"]

    def said(*words: str) -> str:
        assert main(["predict", *words]) == 2
        return capsys.readouterr().err

    assert "predict posterior.json SCENE" in said(str(inferred), *at)
    assert "is of a closed loop" in said(str(inferred), scene, *at, "--corrected")
    assert "at least 2" in said(str(inferred), scene, *at, "--pours", "1")
    unknown = said(str(inferred), scene, "--at", "funnel.height=0.1")
    assert "funnel.height" in unknown and "sliding_friction" not in unknown
    # What was inferred is replaced, and that is said.
    words = ["--at", "material.sliding_friction=0.1", "--pours", "2", "--threads", "1"]
    assert main(["predict", str(inferred), scene, *words]) == 0
    assert "no longer what was inferred" in capsys.readouterr().err
