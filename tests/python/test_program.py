"""The command line as one program: help, completions and suggestions know every command."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import granulcal as gc
from granulcal.cli import _parser, main

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


def test_every_command_that_ends_with_results_takes_json() -> None:
    without = {"demo", "reproduce"}
    for name, parser in _parser()._actions[-1].choices.items():  # pyright: ignore
        inner = [a.choices for a in parser._actions if a.choices and hasattr(a, "_parser_class")]
        parsers = [p for choices in inner for p in choices.values()] or [parser]
        for each in parsers:
            flags = {word for action in each._actions for word in action.option_strings}
            assert name in without or "--json" in flags, each.prog


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
    assert main([*words, "--dry-run"]) == 0
    assert capsys.readouterr().out.startswith("about ")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.toml", "x.bag"]
