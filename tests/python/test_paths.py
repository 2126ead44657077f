"""Every command from the parser itself: it replaces no input and no file of another kind."""

import argparse
from collections.abc import Iterator
from pathlib import Path

import pytest

import granulcal as gc
from granulcal import cli, paths
from granulcal.paths import Reads, Writes

TEXT = 'name = "mine"\n[grains]\ncount = 3\n'
# The first file that a kind of output writes, for those that are folders.
FIRST = {
    "model": "model.json",
    "plots": "coverage.png",
    "calibration": "pours.json",
    "loop": "preregistration.json",
    "rings": "plan.csv",
    "spill": "pours.json",
    "report": "report.html",
}


def commands(
    parser: argparse.ArgumentParser, words: tuple[str, ...] = ()
) -> Iterator[tuple[tuple[str, ...], argparse.ArgumentParser]]:
    below = cli._subparsers(parser)
    if words and not below:
        yield words, parser
    for name, sub in below.items():
        yield from commands(sub, (*words, name))


def line(
    words: tuple[str, ...], parser: argparse.ArgumentParser, given: dict[str, Path], other: Path
) -> list[str]:
    """A command line with what must be given, and these arguments with these values."""
    result = list(words)
    for action in paths.actions(parser):
        value = given.get(action.dest)
        if action.option_strings:
            if value is not None or action.required:
                result += [action.option_strings[-1], str(value or _some(action, other))]
        elif value is not None or action.nargs != "?":
            result.append(str(value or _some(action, other)))
    return result


def _some(action: argparse.Action, other: Path) -> object:
    """A value that the parser takes where one must stand."""
    if action.choices:
        return next(iter(action.choices))
    if action.type in (int, float):
        return 1
    return other if isinstance(action.type, Reads | Writes) or action.type is None else "a.b=1"


def test_every_path_says_whether_it_is_read_or_written():
    plain = [
        (" ".join(words), action.dest)
        for words, parser in commands(cli._parser())
        for action in paths.actions(parser)
        if action.type is Path or (isinstance(action.default, Path) and not action.type)
    ]
    assert plain == []
    # Texts that are no paths are known by name: a new one is to be looked at.
    texts = {
        action.dest
        for _, parser in commands(cli._parser())
        for action in paths.actions(parser)
        if action.type is None and action.nargs != 0
    }
    known = {"method", "topic", "camera_topic", "colour_topic", "study", "engine", "to", "scene"}
    assert texts <= known | {
        "material",
        "kind",
        "sample",
        "name",
        "model",
        "at",
        "experiment",
        "set",
        "preset",
    }, texts


def test_no_command_replaces_an_input_or_a_toml_of_another_kind(tmp_path, capsys):
    other = tmp_path / "other"
    outputs = pairs = 0
    for words, parser in commands(cli._parser()):
        arguments = list(paths.actions(parser))
        written = [(a, a.type.kind) for a in arguments if isinstance(a.type, Writes)]
        for number, (output, kind) in enumerate(written):
            outputs += 1
            if kind == "folder" or "--engine" in words:
                continue
            folder = tmp_path / f"{'-'.join(words)}-{number}"
            folder.mkdir()
            first = FIRST.get(kind)
            path = folder if first else folder / "mine.toml"
            victim = folder / first if first else path
            victim.write_text(TEXT)
            lines = [line(words, parser, {output.dest: path}, other)]
            for each in arguments:
                if isinstance(each.type, Reads) and each.type.kind != "kept":
                    lines.append(line(words, parser, {output.dest: path, each.dest: victim}, other))
                    pairs += 1
            for one in lines:
                assert cli.main(one) == 2, one
                error = capsys.readouterr().err
                assert victim.name in error and "another name" in error, (one, error)
                assert victim.read_text() == TEXT, one
                assert list(folder.iterdir()) == [victim], one
    assert outputs >= 10 and pairs >= 20


def test_paths_are_tested_before_the_pour(tmp_path, capsys):
    scene = tmp_path / "missing-folder" / "x.json"
    words = ["infer", str(tmp_path / "model"), str(tmp_path / "a.png"), "-o", str(scene)]
    assert cli.main(words) == 2
    assert "make it first" in capsys.readouterr().err


def test_a_recorded_camera_does_not_eat_the_measured_one(tmp_path):
    camera = gc.Camera.overhead(height=0.4, field_width=0.4, pixels=64)
    grains = [[0.0, 0.0, 0.01]], [0.01]
    camera.record(*grains, tmp_path)
    gc.Camera.overhead(height=0.3, field_width=0.4, pixels=64).record(*grains, tmp_path)
    mine = (tmp_path / "camera.toml").read_text() + "[segmentation]\nborder_px = 4\n"
    (tmp_path / "camera.toml").write_text(mine)
    before = (tmp_path / "depth.png").read_bytes()
    with pytest.raises(ValueError, match=r"camera.toml is left as it is"):
        camera.record(*grains, tmp_path)
    assert (tmp_path / "camera.toml").read_text() == mine
    assert (tmp_path / "depth.png").read_bytes() == before
