"""`granulcal calibrate` of what a scene observes: tables in place of depth images."""

import json
import math
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.within_budget import calibrate_observed

OBSERVE = "[observe]\nrate = 100.0\n[observe.radius]\npercentiles = [50.0, 90.0]\n"
PRIOR = """
[[parameter]]
path = "material.rolling_friction"
distribution = "uniform"
low = 0.05
high = 0.8
"""


@pytest.fixture(scope="module")
def scene() -> gc.Scene:
    plain = gc.Scene.drop(0.02, count=30, preset="fast")
    return gc.Scene.from_toml(f"{plain.to_toml()}\n{OBSERVE}")


@pytest.fixture
def folder(tmp_path: Path, scene: gc.Scene, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    (tmp_path / "plain.toml").write_text(gc.Scene.drop(0.02, count=30).to_toml())
    (tmp_path / "prior.toml").write_text(PRIOR)
    hidden = scene.with_({"material.rolling_friction": 0.4})
    for name, seed in (("a", 1), ("b", 2)):
        seen = gc.simulate(hidden, seed=seed).observed()
        rows = "".join(f"{each},{seen[each]}\n" for each in scene.observed_names)
        (tmp_path / f"{name}.csv").write_text(f"statistic,value\n{rows}")
    half = (tmp_path / "a.csv").read_text().splitlines()[:2]
    (tmp_path / "half.csv").write_text("\n".join(half) + "\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


WORDS = ["--budget", "60", "--threads", "1", "-q"]


def test_tables_are_calibrated_by_the_statistics_that_all_of_them_have(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["calibrate", "scene.toml", "prior.toml", "a.csv", "b.csv", *WORDS]
    assert main([*asked, "-o", "run", "--json"]) in (0, 3)
    told = json.loads(capsys.readouterr().out)
    low, high = told["parameters"]["material.rolling_friction"]["interval90"]
    assert low < 0.4 < high and high - low < 0.6
    assert told["recordings"] == ["a.csv", "b.csv"] and told["warnings"] == []
    kept = json.loads((Path("run") / "posterior.json").read_text(encoding="utf-8"))
    assert gc.Scene.from_toml(kept["scene_toml"]) == gc.Scene.load("scene.toml")
    # The folder is of these measurements, and goes on.
    assert main([*asked, "-o", "run"]) in (0, 3)
    capsys.readouterr()
    others = ["calibrate", "scene.toml", "prior.toml", "a.csv", "half.csv", *WORDS]
    assert main([*others, "-o", "run"]) == 2
    assert "made for another recording" in capsys.readouterr().err
    assert main([*others, "-o", "other", "--json"]) in (0, 3)
    left_out = json.loads(capsys.readouterr().out)["warnings"]
    assert left_out[0] == "radius[90] is left out: half.csv has no value of it"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["plain.toml", "prior.toml", "a.csv"], "observes nothing else: say under [observe]"),
        (["scene.toml", "prior.toml", "a.csv", "--camera", "camera.toml"], "of depth images"),
        (["scene.toml", "prior.toml", "a.csv", "a.csv"], "given once, got a.csv twice"),
        (["scene.toml", "prior.toml", "x.png", "--fps", "3"], "not with images"),
        (["scene.toml", "prior.toml", "a.csv", "--width", "0.1"], "takes series, not width"),
    ],
)
def test_what_is_no_measurement_of_the_scene_is_refused_before_a_pour(
    folder: Path, words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "camera.toml").write_text("")
    (folder / "x.png").write_bytes(b"")
    assert main(["calibrate", *words, *WORDS, "-o", "out"]) == 2
    assert told in capsys.readouterr().err
    assert not (folder / "out").exists()


def test_something_must_have_been_measured(scene: gc.Scene, tmp_path: Path) -> None:
    prior = gc.Prior.from_toml(PRIOR)
    nothing = dict.fromkeys(scene.observed_names, math.nan)
    for measured in ({}, {"a.csv": nothing}):
        with pytest.raises(ValueError, match=r"must have a value of one of radius\[50\], radius"):
            calibrate_observed(scene, prior, measured, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()
