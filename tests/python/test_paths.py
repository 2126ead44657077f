"""Every command from the parser itself: it replaces no input and no file of another kind."""

import argparse
import errno
import os
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import granulcal as gc
from granulcal import cli, paths
from granulcal.commands import elsewhere
from granulcal.files import write_beside, write_toml
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
    "data_set": "manifest.toml",
}
# An ending of those kinds that have no other.
ENDING = {"film": "gif", "messages": "bag"}


def every_command() -> Iterator[tuple[tuple[str, ...], argparse.ArgumentParser]]:
    """Commands of the program, and those that take the simulator's words for another engine."""
    yield from commands(cli._parser())
    for words, parser in commands(elsewhere.parser()):
        yield (*words, "--engine=lammps"), parser


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
        if action.dest == "engine" and any(word.startswith("--engine") for word in words):
            continue
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
        for words, parser in every_command()
        for action in paths.actions(parser)
        if action.type is Path or (isinstance(action.default, Path) and not action.type)
    ]
    assert plain == []
    # Texts that are no paths are known by name: a new one is to be checked.
    texts = {
        action.dest
        for _, parser in every_command()
        for action in paths.actions(parser)
        if action.type is None and action.nargs != 0
    }
    known = {"method", "topic", "camera_topic", "colour_topic", "study", "engine", "to", "scene"}
    assert texts <= known | {
        "ray",
        "series",
        "ray_store",
        "material",
        "kind",
        "sample",
        "name",
        "model",
        "at",
        "experiment",
        "set",
        "preset",
        "shard",
        "flush_every",
        # Of another engine these are refused, whatever they say.
        *elsewhere._OURS,
    }, texts


def test_no_command_replaces_an_input_or_a_toml_of_another_kind(tmp_path, capsys):
    other = tmp_path / "other"
    outputs = pairs = 0
    for words, parser in commands(cli._parser()):
        arguments = list(paths.actions(parser))
        written = [(a, a.type.kind) for a in arguments if isinstance(a.type, Writes)]
        for number, (output, kind) in enumerate(written):
            outputs += 1
            if kind == "folder":
                # What is in it is known to the command alone: `test_folders_...` below.
                continue
            folder = tmp_path / f"{'-'.join(words)}-{number}"
            folder.mkdir()
            first = FIRST.get(kind)
            path = folder if first else folder / f"mine.{ENDING.get(kind, 'toml')}"
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
    assert outputs >= 17 and pairs >= 35, (outputs, pairs)


def test_paths_are_tested_before_the_pour(tmp_path, capsys):
    scene = tmp_path / "missing-folder" / "x.json"
    words = ["infer", str(tmp_path / "model"), str(tmp_path / "a.png"), "-o", str(scene)]
    assert cli.main(words) == 2
    assert "make it first" in capsys.readouterr().err


def test_a_figure_has_an_ending_that_can_be_drawn(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    words = ["infer", str(tmp_path / "model"), str(tmp_path / "a.png"), "--plot"]
    assert cli.main([*words, str(tmp_path / "pair.xyz")]) == 2
    error = capsys.readouterr().err
    assert "--plot: " in error and ".pdf, " in error and "got .xyz" in error
    for name in ("pair", "pair.PNG"):
        assert cli.main([*words, str(tmp_path / name)]) == 2
        assert "--plot" not in capsys.readouterr().err


def test_a_model_finds_its_place_before_the_training(tmp_path, capsys, monkeypatch):
    from granulcal.starter.make_model import make_model

    taken = tmp_path / "pours"
    taken.mkdir()
    (taken / "part-000000.parquet").write_text("mine")
    monkeypatch.setattr("granulcal.bayessim.BayesSim.fit", lambda *_, **__: pytest.fail("trained"))
    for words in (["train", str(taken)], ["train", str(taken), "--dry-run"], ["model", "drop"]):
        assert cli.main([*words, "-o", str(taken)]) == 2, words
        error = capsys.readouterr().err
        assert "--out: " in error and "not a saved model" in error and "another folder" in error
    with pytest.raises(FileExistsError, match="not a saved model"):
        make_model("drop", pours=50, out=taken)
    assert [path.name for path in taken.iterdir()] == ["part-000000.parquet"]


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


def test_folders_of_which_nothing_is_known_are_these():
    """A new command with such a folder is to be checked: what it writes must replace no input."""
    folders = {
        words[0]
        for words, parser in every_command()
        for action in paths.actions(parser)
        if isinstance(action.type, Writes) and action.type.kind == "folder"
    }
    assert folders == {"init", "sample", "reproduce"}


def test_init_replaces_nothing_unless_it_is_told_to(tmp_path, capsys):
    for name in ("scene.toml", "prior.toml", "camera.toml", "loop.toml"):
        folder = tmp_path / name.partition(".")[0]
        folder.mkdir()
        (folder / name).write_text(TEXT)
        assert cli.main(["init", str(folder)]) == 1
        assert "--force" in capsys.readouterr().err
        assert (folder / name).read_text() == TEXT
        assert [path.name for path in folder.iterdir()] == [name]


def test_a_sample_replaces_no_document(tmp_path, capsys):
    words = ["init", str(tmp_path), "--scene", "drop", "--set", "grains.count=20"]
    assert cli.main([*words, "--preset", "fast"]) == 0
    documents = {path: path.read_text() for path in tmp_path.glob("*.toml")}
    for name in (".sensor.toml", "couscous.bag.part", "couscous.png", "couscous.mcap"):
        (tmp_path / name).write_text(TEXT)
    assert cli.main(["sample", str(tmp_path)]) == 2
    assert "couscous.png is left as it is" in capsys.readouterr().err
    (tmp_path / "couscous.png").unlink()
    assert cli.main(["sample", str(tmp_path)]) == 2
    assert "couscous.mcap is left as it is" in capsys.readouterr().err
    # All are looked at before the first is written.
    assert not (tmp_path / "couscous.png").exists()
    for name in (".sensor.toml", "couscous.bag.part", "couscous.mcap"):
        assert (tmp_path / name).read_text() == TEXT
    assert {path: path.read_text() for path in documents} == documents


def test_a_sample_replaces_samples_and_no_recording(tmp_path, capsys):
    pytest.importorskip("rosbags")
    words = ["init", str(tmp_path), "--scene", "drop", "--set", "grains.count=20"]
    assert cli.main([*words, "--preset", "fast"]) == 0
    again = ["sample", str(tmp_path)]
    assert cli.main(again) == 0
    assert cli.main([*again, "--seed", "3"]) == 0
    for name in ("couscous.bag", "couscous.mcap", "couscous.png", "wall.bag"):
        path = tmp_path / name
        mine = path.read_bytes()
        # One's own recording under the name that the guide gives to it.
        path.write_bytes(mine + b"\0")
        before = {each: each.read_bytes() for each in tmp_path.iterdir() if each.is_file()}
        assert cli.main(again) == 2
        assert f"{name} is left as it is" in capsys.readouterr().err
        assert {each: each.read_bytes() for each in before} == before
        path.write_bytes(mine)
    (tmp_path / "truth.json").write_text("{}")
    assert cli.main(again) == 2
    assert "truth.json" in capsys.readouterr().err
    assert (tmp_path / "truth.json").read_text() == "{}"


def test_the_model_of_a_built_in_scene_replaces_no_other_file(tmp_path, capsys):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "model.json").write_text(TEXT)
    with pytest.raises(ValueError, match="is left as it is"):
        write_beside(tmp_path / "mine" / "model.json", "{}")
    assert (tmp_path / "mine" / "model.json").read_text() == TEXT


def test_a_disk_that_is_full_names_the_file(tmp_path, capsys, monkeypatch):
    def full(self, data):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "write_bytes", full)
    assert cli.main(["init", str(tmp_path / "new")]) == 1
    error = capsys.readouterr().err
    assert "scene.toml: cannot write: No space left on device" in error, error
    assert list((tmp_path / "new").iterdir()) == []


def test_samples_that_were_stopped_can_be_made_again(tmp_path, monkeypatch):
    words = ["init", str(tmp_path), "--scene", "drop", "--set", "grains.count=20"]
    assert cli.main([*words, "--preset", "fast"]) == 0
    with monkeypatch.context() as patch:

        def full(*_, **__):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        patch.setattr("granulcal.starter.samples.write_bag", full)
        assert cli.main(["sample", str(tmp_path)]) == 1
    assert (tmp_path / "couscous.png").exists()
    assert cli.main(["sample", str(tmp_path)]) == 0


def test_files_of_studies_replace_no_document_that_was_changed(tmp_path):
    path = tmp_path / "camera.toml"
    write_toml(path, "width = 3\n")
    write_toml(path, "width = 3\n")
    path.write_text(TEXT)
    with pytest.raises(ValueError, match="camera.toml is left as it is"):
        write_toml(path, "width = 3\n")
    assert path.read_text() == TEXT


def test_nothing_writes_a_document_past_the_checks():
    """Files are written by `files.py`; what else writes is of folders that nobody else has."""
    allowed = {
        "files.py": 2,
        # Folders of their own in the place for temporary files.
        "bayessim/model.py": 1,
        "engines/command.py": 2,
        "pours/stored_parts.py": 1,
        "starter/samples.py": 1,
    }
    package = Path(gc.__file__).parent
    found = {}
    for file in package.rglob("*.py"):
        count = len(re.findall(r"\.write_(?:text|bytes)\(", file.read_text(encoding="utf-8")))
        if count:
            found[file.relative_to(package).as_posix()] = count
    assert found == {**allowed, "files.py": found.get("files.py", 0)}, found


def test_a_film_takes_no_name_that_is_taken_and_no_number_that_never_ends(tmp_path, capsys):
    path = tmp_path / "film.gif"
    words = ["film", "drop", "--set", "grains.count=12", "-o", str(path), "--width", "64"]
    (tmp_path / "film.gif.part").write_text(TEXT)
    path.write_text(TEXT)
    assert cli.main(words) == 2
    assert "left as it is" in capsys.readouterr().err or "another name" in capsys.readouterr().err
    path.unlink()
    for option, value in (("--fps", "1e12"), ("--fps", "nan"), ("--width", "1000000000")):
        assert cli.main([*words, option, value]) == 2
        assert option[2:] in capsys.readouterr().err
    assert cli.main([*words, "--fps", "5", "--slow", "1"]) == 0
    assert path.read_bytes()[:4] == b"GIF8"
    assert (tmp_path / "film.gif.part").read_text() == TEXT


def test_a_film_lasts_as_long_as_its_rate_says_and_tells_what_it_lacks(tmp_path, capsys):
    from PIL import Image

    from granulcal.pours.film import _frame_times

    # Frames of a GIF are whole hundredths: 15 a second had been 17.
    assert sum(_frame_times(15, 15.0)) == 1000
    assert set(_frame_times(15, 15.0)) == {60, 70}
    path = tmp_path / "film.gif"
    words = ["film", "drop", "--set", "grains.count=12", "-o", str(path), "--width", "64"]
    assert cli.main([*words, "--most-frames", "4"]) == 0
    told = capsys.readouterr()
    assert "frames of the pour are left out" in told.err and "--most-frames" in told.err
    with Image.open(path) as image:
        assert getattr(image, "n_frames", 1) == 5
    assert cli.main([*words, "--most-frames", "100"]) == 0
    assert "left out" not in capsys.readouterr().err


def test_a_figures_folder_is_asked_for_before_the_work(tmp_path, capsys):
    """The posterior was told and written, and only then was there no folder for its picture."""
    recording, out = tmp_path / "a.png", tmp_path / "posterior.json"
    recording.write_bytes(b"")
    words = ["infer", "funnel", str(recording), "-o", str(out)]
    assert cli.main([*words, "--plot", str(tmp_path / "no" / "pair.png")]) == 2
    told = capsys.readouterr()
    assert "--plot: the folder" in told.err and "does not exist; make it first" in told.err
    assert not told.out and not out.exists()
