"""The command line as one program: help, completions and suggestions know every command."""

import argparse
import importlib
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import _guarded, _parser, _subparsers, main
from granulcal.commands.counts import pour_count
from granulcal.pours.pour_time import PourKind, in_the_middle
from granulcal.warned import warn

ALL = """
scene simulate generate render features infer fit-sensor pick-colour inspect merge completions
init sample model train check calibrate report close-loop design export film record reproduce demo
"""


def _told(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "granulcal.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_help_names_every_command_once_and_the_program() -> None:
    text = _told("--help").stdout
    names = re.findall(r"^  ([a-z][a-z-]*)  ", text.partition("Options:")[0], flags=re.M)
    assert len(names) == len(set(names)) and set(ALL.split()) <= set(names)
    assert "Usage: granulcal " in text and "granulcal-cli" not in text


@pytest.mark.parametrize("words", [["infer"], ["export", "posterior"], ["generate"]])
def test_the_word_help_says_what_the_option_does(words: list[str]) -> None:
    asked = _told("help", *words)
    assert asked.returncode == 0 and asked.stdout == _told(*words, "--help").stdout


@pytest.mark.parametrize("word", ["simulate", "features", "completions", "fit-sensor"])
def test_help_of_the_simulators_half_names_granulcal(word: str) -> None:
    text = _told(word, "--help").stdout
    assert f"granulcal {word}" in text and "granulcal-cli" not in text


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["trian"], "train"),
        (["simulat", "funnel"], "simulate"),
        (["close-lop", "x"], "close-loop"),
        (["train", "pours", "-o", "m", "--sead", "1"], "--seed"),
        (["simulate", "funnel", "--sead", "1"], "--seed"),
        (["export", "scene", "drop", "--to", "lammps", "-o", "x", "--yung", "1"], "--young"),
    ],
)
def test_a_misspelt_word_is_answered_with_the_one_that_was_meant(
    words: list[str], meant: str
) -> None:
    done = _told(*words)
    assert done.returncode == 2 and meant in done.stderr


def test_an_option_of_another_command_is_not_what_was_meant() -> None:
    done = _told("sample", "couscous", "-o", "scene.toml")
    assert done.returncode == 2 and "unrecognized arguments: -o" in done.stderr
    assert "did you mean" not in done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["infer", "m", "x.bag", "--json", "a.json"], "--json takes no value, got 'a.json'"),
        (["infer", "m", "x.bag", "--json=a.json"], "--json takes no value, got 'a.json'"),
        (["design", "rings", "drop", "-o", "x", "--extrapolate", "yes"], "--extrapolate takes no"),
    ],
)
def test_a_value_that_an_option_does_not_take_is_told_with_the_option(
    words: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    said = capsys.readouterr().err
    assert told in said and "did you mean" not in said
    # What is printed may go to a file all the same.
    assert ("--json > a.json" in said) == (told.startswith("--json"))
    # How the command itself is used, not the program.
    assert said.startswith(f"usage: granulcal {' '.join(words[: 1 + (words[0] == 'design')])} [-h]")


@pytest.mark.parametrize(
    "words",
    [
        ["init", "folder"],
        ["sample", "folder"],
        ["film", "drop", "-o", "x.gif"],
        ["simulate", "drop", "--engine", "mujoco"],
        ["export", "scene", "drop", "--to", "yade", "-o", "x"],
    ],
)
def test_a_number_of_the_scene_is_refused_alike_by_every_command(
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    for word, told in (
        ("grains.count", "must be PATH=NUMBER, got 'grains.count'"),
        ("=1", "must be PATH=NUMBER, got '=1'"),
        ("end.horizon=long", "end.horizon must be a number, as in end.horizon=0.5"),
        ("end.horizon=nan", "end.horizon must be a number, as in end.horizon=0.5"),
    ):
        assert main([*words, "--set", word]) == 2
        assert f"argument --set: {told}" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_help_fits_a_terminal_of_80_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    parser = _parser()
    asked = [*_subparsers(parser).values(), *parsers(parser).values()]
    wide = [line for each in asked for line in each.format_help().split("\n") if len(line) > 80]
    assert wide == []


def test_a_warning_steers_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    warn(["first", "a\x1b[2Jb"])
    assert capsys.readouterr().err == "warning: first\nwarning: a\\u{1b}[2Jb\n"


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completions_know_the_commands_of_both_halves(shell: str) -> None:
    script = _told("completions", shell).stdout
    for word in ("close-loop", "fit-sensor", "calibrate"):
        assert word in script
    assert "--budget" in script or "budget" in script
    assert "granulcal-cli" not in script


def test_help_and_completions_know_the_options_of_the_python_package() -> None:
    for words in (("generate", "--help"), ("completions", "bash")):
        told = _told(*words).stdout
        assert "--ray " in told and "--ray-store" in told and "--engine" in told, words


def test_a_store_is_of_a_cluster(capfd: pytest.CaptureFixture[str]) -> None:
    from granulcal import _native

    words = ["generate", "drop", "default", "-o", "pours", "--ray-store", "store"]
    assert main(words) == 2 and "belongs to --ray" in capfd.readouterr().err
    assert _native.run_cli(["granulcal-cli", *words]) == 2
    assert "--ray-store" in capfd.readouterr().err


@pytest.mark.parametrize("url", ["bogus://parts", ""])
def test_a_store_that_is_none_is_refused_before_anything_is_started(
    url: str, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    pytest.importorskip("fsspec")
    # Nobody listens there: a cluster that is asked for first would be what is missing.
    cluster = ["--ray", "127.0.0.1:1", "--ray-store", url]
    generated, out = tmp_path / "pours", tmp_path / "out"
    for words in (
        ["generate", "drop", "default", "-n", "2", "-o", str(generated)],
        ["generate", "drop", "default", "-n", "2", "-o", str(generated), "--dry-run"],
        ["reproduce", "paper", "--quick", "--out", str(out)],
    ):
        assert main([*words, *cluster]) == 2
        said = capfd.readouterr().err
        assert "the store must be a folder's URL" in said and "file:///shared/run" in said, said
        assert url in said
    assert not generated.exists() and not out.exists()


# Commands that do not say how long they would take, and why; granulcal-cli has its own list.
NO_DRY_RUN = {
    "init": "writes four files",
    "sample": "five pours, which a trial of three would nearly be",
    "infer": "evaluates a trained model: seconds",
    "export material": "writes a file",
    "export posterior": "writes files",
    "export scene": "writes files",
    "export bed": "one pour",
    "export frames": "one pour",
    "film": "one pour, whose line says how far it is",
    "record": "as long as the camera takes for its frames",
}


def parsers(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Returns the parsers of all commands by name, those of words in words one by one."""
    found = {}
    for name, each in _subparsers(parser).items():
        inner = parsers(each)
        found |= {f"{name} {word}": p for word, p in inner.items()} or {name: each}
    return found


@pytest.mark.parametrize(("flag", "without"), [("--json", {}), ("--dry-run", NO_DRY_RUN)])
def test_every_command_takes_json_and_says_how_long_it_would_take(
    flag: str, without: dict[str, str]
) -> None:
    found = parsers(_parser())
    has = {name for name, parser in found.items() if flag in parser._option_string_actions}
    assert set(found) - has == set(without)


def test_words_in_words_take_the_flags_before_and_behind() -> None:
    """`design spill ... -q` had been refused: the flag had its place between the two words only."""
    parser = _parser()
    assert {
        name for name, each in parsers(parser).items() if "-q" not in each.format_usage()
    } == set()
    rest = ["rings", "funnel", "--pile", "0.03", "-o", "plan"]
    for words in (["design", "-q", *rest], ["design", *rest, "-q"]):
        assert (parser.parse_args(words).quiet, parser.parse_args(words).verbose) == (True, 0)
    told = parser.parse_args(["design", *rest, "-vv"])
    assert (told.quiet, told.verbose) == (False, 2)


def test_an_engine_needs_the_python_package(capfd: pytest.CaptureFixture[str]) -> None:
    from granulcal import _native

    assert _native.run_cli(["granulcal-cli", "simulate", "drop", "--engine", "lammps"]) == 2
    assert "Python package" in capfd.readouterr().err
    assert main(["completions", "--help"]) == 0


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "{scene}", "default", "x.bag", "-o", "run", "--budget", "70"],
        ["design", "rings", "{scene}", "--pile", "0.04", "-o", "plan", "--pours", "70"],
    ],
)
def test_a_dry_run_says_how_long_and_makes_nothing(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.bag").write_bytes(b"")
    scene = gc.Scene.funnel(0.05, count=30, preset="fast")
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    words = [word.format(scene="scene.toml") for word in words]
    assert main([*words, "--dry-run", "--json", "--threads", "2"]) == 0
    told = json.loads(capsys.readouterr().out)
    # As `generate --dry-run` says it.
    assert told["missing"] == 70 and told["threads"] == 2
    assert told["seconds"] == pytest.approx(70 * told["pour_cpu_s"] / 2) and told["seconds"] > 0
    assert told["extrapolated"] is False
    assert main([*words, "--dry-run"]) == 0
    assert capsys.readouterr().out.startswith("about ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml", "x.bag"]


def test_a_dry_run_of_long_pours_says_what_it_extrapolated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("granulcal.pours.pour_time.PATIENCE_S", 1.5)
    (tmp_path / "x.bag").write_bytes(b"")
    # Hours each: they are begun, and no more.
    scene = gc.Scene.funnel(0.05, count=2000, preset="accurate")
    scene = scene.with_({"end.horizon": 900.0, "end.kinetic_energy": 1e-300})
    (tmp_path / "scene.toml").write_text(scene.to_toml())
    words = ["calibrate", "scene.toml", "default", "x.bag", "-o", "run", "--budget", "70"]
    begun = time.monotonic()
    assert main([*words, "--dry-run", "--json"]) == 0
    assert time.monotonic() - begun < 60
    told = json.loads(capsys.readouterr().out)
    assert told["extrapolated"] is True and told["pour_cpu_s"] > 60
    assert main([*words, "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert "a pour was stopped after" in said and "until its horizon of 900 s" in said
    assert not (tmp_path / "run").exists()


def test_a_dry_run_of_training_and_check_says_how_long_and_makes_nothing(
    small_data: gc.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    pytest.importorskip("torch")
    pours, model = str(small_data.path), str(tmp_path / "model")
    words = ["train", pours, "-o", model]
    assert main([*words, "--dry-run", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["emulator_s"] > 0 and told["network_s"] > 0
    assert told["seconds"] == told["emulator_s"] + told["network_s"]
    assert main([*words, "--method", "emulated", "--dry-run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["network_s"] == 0
    assert list(tmp_path.iterdir()) == []
    assert main([*words, "--method", "emulated"]) == 0
    capsys.readouterr()
    assert main(["check", model, "--data", pours]) == 2
    assert "are among those that" in capsys.readouterr().err
    (tmp_path / "model" / "training.parquet").unlink()
    assert main(["check", model, "--data", pours, "--dry-run"]) == 0
    assert capsys.readouterr().out.startswith("about ")
    assert main(["check", model, "--data", pours, "--dry-run", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["posteriors"] == small_data.is_usable.sum() and told["seconds"] > 0


def test_pours_beside_a_model_that_was_saved_over_another_are_not_taken_for_its_own(
    small_data: gc.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """They had been: pours that it was trained on could check it, and a report was of others."""
    pytest.importorskip("torch")
    model, pours = tmp_path / "model", str(small_data.path)
    (tmp_path / "x.bag").write_bytes(b"")
    words = ["report", str(model), str(tmp_path / "x.bag"), "-o", str(tmp_path / "page.html")]
    for asked, sign in ((80, 1.0), (70, 1.0), (80, -1.0)):
        x = sign * small_data.x[:asked]
        made = gc.BayesSim.fit(
            small_data.theta[:asked], x, small_data.prior, x_names=small_data.x_names,
            scene=small_data.scene, quiet=True, method="emulated",
        )  # fmt: skip
        made.save(model)
        if asked == 80 and sign > 0:
            small_data.save(model / "training.parquet")
            assert main([*words, "--dry-run"]) == 0
            continue
        for refused in (words, ["check", str(model), "--data", pours]):
            capsys.readouterr()
            assert main(refused) == 2
            assert "training.parquet has other pours than the model" in capsys.readouterr().err
    assert main([*words, "--data", pours, "--dry-run"]) == 0


def test_a_dry_run_of_a_report_counts_its_pours(
    small_data: gc.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    pytest.importorskip("torch")
    model = gc.BayesSim.fit(small_data, quiet=True, method="emulated")
    model.save(tmp_path / "model")
    (tmp_path / "x.bag").write_bytes(b"")
    words = ["report", str(tmp_path / "model"), str(tmp_path / "x.bag"), "--data"]
    words += [str(small_data.path), "-o", str(tmp_path / "r.html"), "--seeds", "2", "--draws", "3"]
    assert main([*words, "--dry-run", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["missing"] == 7
    assert not (tmp_path / "r.html").exists()


def test_a_study_of_several_kinds_of_pours_says_how_long_each_takes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    scene = gc.Scene.funnel(0.05, count=30, preset="fast")
    low = gc.Prior(
        [gc.Parameter(path="material.restitution", distribution="uniform", low=0.1, high=0.2)]
    )
    other = scene.with_({"grains.count": 20.0})
    kinds = [PourKind("one", scene, low, 5), PourKind("two", other, low, 7)]
    kinds.append(PourKind("one more", scene, low, 10))
    module = importlib.import_module("granulcal.experiments.predictions")
    monkeypatch.setattr(module, "poured", lambda data: kinds)
    words = ["reproduce", "predictions", "--data", str(tmp_path), "--out", str(tmp_path / "out")]
    assert main([*words, "--dry-run"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("about ") and ": 22 pours at most, " in said[0]
    assert [line.partition(":")[0].strip() for line in said[1:]] == [
        "5 pours of one",
        "7 pours of two",
        "10 pours of one more",
    ]
    assert main([*words, "--dry-run", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["missing"] == 22 and told["seconds"] > 0 and told["extrapolated"] is False
    assert not (tmp_path / "out").exists()


def test_a_study_says_how_long_its_archive_takes_and_others_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    assert main(["reproduce", "--json"]) == 0
    studies = json.loads(capsys.readouterr().out)["studies"]
    assert "loop_column" in studies
    for study in studies:
        module = importlib.import_module(f"granulcal.experiments.{study}")
        assert hasattr(module, "reproduce") or hasattr(module, "reproduce_paper"), study
    words = ["--data", str(tmp_path), "--out", str(tmp_path / "out"), "--dry-run"]
    assert main(["reproduce", "sensor", *words]) == 2
    assert "--dry-run is of studies" in capsys.readouterr().err
    # The archive's pours come from the scene of the study: no measurement is read for them.
    for study in ("kinect_mounds", "loop_column", "loop_drum", "loop_mounds", "loop_rings"):
        module = importlib.import_module(f"granulcal.experiments.{study}")
        [kind] = module.poured(tmp_path)
        assert in_the_middle(kind.scene, kind.prior).get("grains.count") > 0
        assert kind.count >= 500


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["film", "funel", "-o", "x.gif"], "funnel"),
        (["export", "scene", "funel", "--to", "lammps", "-o", "x"], "funnel"),
        (["calibrate", "funel", "default", "x.bag", "-o", "run"], "funnel"),
        (["init", "x", "--scene", "funel"], "funnel"),
        (["model", "funel"], "funnel"),
        (["simulate", "funel"], "funnel"),
        (["generate", "drop", "default2", "-o", "d"], "default"),
        (["calibrate", "drop", "default2", "x.bag", "-o", "run"], "default"),
        (["export", "scene", "drop", "--to", "lamps", "-o", "x"], "lammps"),
        (["reproduce", "papr"], "paper"),
    ],
)
def test_a_misspelt_name_is_answered_with_the_one_that_was_meant(
    words: list[str], meant: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.bag").write_bytes(b"")
    assert main(words) == 2
    assert f"did you mean {meant}?" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["film", "drop", "-o", "x.gif", "--fps", "fast"], "--fps: must be a number, got 'fast'"),
        (["model", "drop", "-n", "1e3"], "-n/--pours: must be a whole number, got '1e3'"),
        (
            ["report", "funnel", "x", "-o", "y", "--frames", "few"],
            "of at least 1, or all, got 'few'",
        ),
        (["design", "rings", "drop", "-o", "x", "--ring", "a", "1"], "--ring: must be a number"),
    ],
)
def test_what_is_no_number_is_not_told_in_words_of_python(
    words: list[str], told: str, capfd: pytest.CaptureFixture[str]
) -> None:
    """It had been an `invalid float value`, and an `invalid _frames value`."""
    assert main(words) == 2
    said = capfd.readouterr().err
    assert told in said and "invalid" not in said


def test_a_file_that_is_not_there_is_named_without_the_number_of_the_error(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mine.toml"
    assert main(["train", str(path), "-o", str(tmp_path / "model")]) == 2
    assert capfd.readouterr().err == f"granulcal: {path}: cannot read: No such file or directory\n"
    assert main(["film", str(path), "-o", str(tmp_path / "x.gif")]) == 2
    told = f"{str(path)!r} is no file and no built-in scene (funnel, drop)"
    assert capfd.readouterr().err == f"granulcal: {told}\n"


@pytest.mark.parametrize(
    "words",
    [
        ["export", "scene", "{}", "--to", "lammps", "-o", "out"],
        ["export", "bed", "{}", "--to", "csv", "-o", "out.csv"],
        ["film", "{}", "-o", "out.gif"],
        ["calibrate", "{}", "default", "bag", "--camera", "bag/camera.toml", "-o", "run"],
    ],
)
def test_a_scene_of_more_grains_than_there_is_room_for_is_refused(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd
) -> None:
    monkeypatch.chdir(tmp_path)
    many = gc.Scene.drop(0.1).with_({"grains.count": 1e8})
    (tmp_path / "many.toml").write_text(many.to_toml())
    camera = gc.Camera.overhead(height=0.4, field_width=0.4, pixels=64)
    grains = np.array([[0.01 * x, 0.01 * y, 0.004] for x in range(5) for y in range(5)])
    camera.record(grains, np.full(len(grains), 0.004), tmp_path / "bag")
    filled = [word.format("many.toml") for word in words]
    assert main(filled) == 2
    told = capfd.readouterr().err
    assert "of memory, and" in told and "GRANULCAL_NO_LIMITS=1" in told, told
    with pytest.raises(ValueError, match="of memory"):
        many.start(0)


@pytest.mark.parametrize(
    ("module", "extra"), [("pyrealsense2", "realsense"), ("av", "film"), ("torch", "all")]
)
def test_what_is_not_installed_is_told_with_the_extra_that_brings_it(
    module: str, extra: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def absent() -> int:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    assert _guarded(absent) == 1
    assert f"pip install 'granulcal[{extra}]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["calibrate", "drop", "default", "x.bag", "-o", "run", "--budget"],
        ["close-loop", "loop.toml", "-o", "run", "--budget"],
        ["report", "funnel", "x.bag", "-o", "x.html", "--seeds"],
        ["report", "funnel", "x.bag", "-o", "x.html", "--draws"],
        ["predict", "run", "--at", "funnel.height=0.1", "--pours"],
        ["design", "rings", "funnel", "--pile", "0.04", "-o", "plan", "--pours"],
        ["demo", "--out", "demo", "--pours"],
    ],
)
def test_more_pours_than_anybody_waits_for_are_refused(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "2000000000"]) == 2
    told = capsys.readouterr().err
    assert "at most 100000 pours, got 2000000000" in told and "GRANULCAL_NO_LIMITS=1" in told
    monkeypatch.setenv("GRANULCAL_NO_LIMITS", "1")
    assert pour_count("2000000000") == 2000000000
