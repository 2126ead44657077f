"""`--engine` of the words `simulate` and `generate`, and `--sensor` beside it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from own_simulators import SIMULATOR

import granulcal as gc
from granulcal.cli import main
from granulcal.pours.statistics import DIAGNOSTIC_NAMES
from granulcal.starter.samples import SENSOR


@pytest.fixture(scope="module")
def folder_of_sensor(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Has a sensor.toml as `fit-sensor` writes it."""
    place = tmp_path_factory.mktemp("sensor")
    (place / "sensor.toml").write_text(SENSOR.format(focal=390.0, unit=1e-4))
    return place


def test_the_words_simulate_and_generate_take_an_engine(
    own_simulator: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, prior = tmp_path / "scene.toml", tmp_path / "prior.toml"
    scene.write_text(gc.Scene.drop(0.02, count=30).to_toml())
    prior.write_text(gc.Prior.default().to_toml())
    assert main(["simulate", str(scene), "--engine", own_simulator, "--json"]) == 0
    assert '"status": "at_rest"' in capsys.readouterr().out
    once = ["simulate", str(scene), "--engine", own_simulator]
    assert main([*once, "--json", "--diagnostics"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (len(told["statistics"]), len(told["diagnostics"])) == (16, len(DIAGNOSTIC_NAMES))
    for option, why in (
        (["--mcap", str(tmp_path / "film.mcap")], "--mcap is not for --engine: only its grains"),
        (["--threads", "2"], "--threads is not for --engine: it takes the cores"),
    ):
        assert main([*once, *option]) == 2
        assert why in capsys.readouterr().err
    words = ["generate", str(scene), str(prior), "-n", "3", "-o", str(tmp_path / "pours")]
    assert main([*words, f"--engine={own_simulator}", "--quiet"]) == 0
    assert len(gc.Dataset.load(tmp_path / "pours")) == 3
    capsys.readouterr()
    more = [*words, f"--engine={own_simulator}", "--quiet", "--json", "-n", "5"]
    assert main(more) == 0
    told = json.loads(capsys.readouterr().out)
    own = ["generate", str(scene), str(prior), "-n", "2", "-o", str(tmp_path / "own"), "--json"]
    own = [sys.executable, "-m", "granulcal.cli", *own, "--quiet"]
    ours = json.loads(subprocess.run(own, capture_output=True, text=True, check=True).stdout)
    assert set(ours) <= set(told)
    assert (told["rows"], told["total"], told["resumed"], told["made"]) == (5, 5, 3, 2)
    assert told["status"] == gc.Dataset.load(tmp_path / "pours").status_counts()


def test_the_options_that_generate_shows_are_taken_or_refused_by_name_elsewhere(
    own_simulator: str, folder_of_sensor: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """They had been unknown: `did you mean --set?`."""
    out, words = tmp_path / "pours", ["generate", "drop", "default", "-n", "12"]
    words += ["--set", "grains.count=30", "-o", str(out)]
    ours = f"--engine={own_simulator}"
    for option, where, why in (
        (["--shard", "0/4"], ["--ray", "local"], "--shard is not for --ray: the cluster divides"),
        (["--shard", "0/4"], [ours], "--shard is not for --engine: one process"),
        (["--flush-every", "5"], ["--ray", "local"], "--flush-every is not for --ray: a part"),
        (["--flush-every", "5"], [ours], "--flush-every is not for --engine: rows"),
        (["--threads", "2"], ["--ray", "local"], "--threads is not for --ray: as many pours run"),
        (["--chunk", "0"], [ours], "chunk must be at least 1, got 0"),
    ):
        assert main([*words, *option, *where]) == 2
        assert why in capsys.readouterr().err
    assert main([*words, ours, "--dry-run", "--json", "--threads", "2"]) == 0
    assert json.loads(capsys.readouterr().out)["missing"] == 12
    assert not out.exists()
    sensor = folder_of_sensor / "sensor.toml"
    more = ["--preset", "fast", "--sensor", str(sensor), "--chunk", "5", "-q", "-v"]
    assert main([*words, ours, *more]) == 0
    assert sorted(path.name for path in out.glob("*.parquet")) == [
        f"part-{i:06}.parquet" for i in range(3)
    ]
    scene = gc.Dataset.load(out).scene
    assert scene.preset == "fast" and scene.get("grains.count") == 30
    assert scene.get("camera.sensor.noise.white") == 0.02


def test_a_sensor_replaces_that_of_the_scene(
    folder_of_sensor: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = folder_of_sensor / "sensor.toml"
    once = gc.Scene.drop(0.1).with_sensor(path)
    other = tmp_path / "other.toml"
    other.write_text(path.read_text().replace("white = 0.02", "white = 0.05"))
    twice = once.with_({"camera.sensor.baseline": 0.07}).with_sensor(other)
    assert twice.get("camera.sensor.noise.white") == 0.05
    assert twice.get("camera.sensor.baseline") == 0.05
    # As the simulator's half reads it.
    capfd.readouterr()
    assert main(["scene", "drop", "--sensor", str(other)]) == 0
    assert gc.Scene.from_toml(capfd.readouterr().out) == twice
    for text, said in (
        ("[camera.sensor", "unclosed table"),
        ("[camera]\nheight = 1.0\n", "unknown field `height`, expected `sensor`"),
        (path.read_text().replace('"stereo"', '"echo"'), "unknown variant `echo`"),
        (path.read_text() + "[grains]\ncount = 3\n", "unknown field `grains`"),
    ):
        other.write_text(text)
        with pytest.raises(ValueError, match=f"(?s)other.toml.*{said}"):
            once.with_sensor(other)


def test_a_pour_without_grains_in_view_is_told_and_ends_with_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    away = tmp_path / "away.py"
    away.write_text(SIMULATOR.replace("r * np.cos(angle)", "9 + r"))
    positions = tmp_path / "p.npy"
    words = ["simulate", "drop", "--set", "grains.count=30", "--engine", f"{sys.executable} {away}"]
    assert main([*words, "--json", "--diagnostics", "--positions", str(positions)]) == 3
    told = json.loads(capsys.readouterr().out)
    assert told["status"] == "no_grains_in_view"
    assert told["statistics"] is None and told["diagnostics"] is None
    assert np.load(positions).shape == (30, 3)
    assert main(words) == 3
    assert "no statistics" in capsys.readouterr().err
