"""The schema of documents: what is wrong is named with its place and what is allowed."""

from pathlib import Path

import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.documents import (
    Flag,
    ListOf,
    Mapping,
    Maybe,
    Number,
    OneOf,
    Table,
    Text,
    Whole,
    check,
    meant,
    parse_json,
    parse_toml,
    read_bytes,
)
from granulcal.errors import ObservationError
from granulcal.loop.task import Task
from granulcal.starter.models import find_model

SCHEMA = Table(
    {"name": Text(("a", "b")), "at": Mapping(Number(0, 1))},
    {"flag": Flag(), "list": ListOf(Whole(1, 5), least=1), "some": Maybe(OneOf((Text(), Flag())))},
)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ([], "the document must be a table"),
        ({"at": {}}, "name must be there"),
        ({"name": "c", "at": {}}, "name must be one of a, b, got 'c'"),
        ({"name": "a", "at": {"x": 2}}, "at.x must be a number from 0 to 1, got 2"),
        ({"name": "a", "at": {"x": float("nan")}}, "at.x must be a number"),
        ({"name": "a", "at": {"x": True}}, "at.x must be a number"),
        ({"name": "a", "at": {}, "flag": "false"}, "flag must be true or false, got 'false'"),
        ({"name": "a", "at": {}, "list": []}, "list must be a list of at least 1"),
        ({"name": "a", "at": {}, "list": [1, 9]}, r"list\[1\] must be a whole number from 1 to 5"),
        ({"name": "a", "at": {}, "some": 3}, "some must be true or false"),
        ({"name": "a", "at": {}, "other": 3}, "other must be absent"),
    ],
)
def test_the_first_fault_is_named(document, said):
    with pytest.raises(ValueError, match=f"file: {said}"):
        check(document, SCHEMA, "file")


def test_what_fits_fits():
    check(
        {"name": "a", "at": {"x": 1}, "list": [1, 5], "some": None, "flag": False}, SCHEMA, "file"
    )


@pytest.mark.parametrize("text", [b"[" * 200_000, b"NaN", b"\xff", b"{", b'{"a": Infinity}'])
def test_what_is_no_json_is_refused_by_name(text):
    with pytest.raises(ValueError, match="x.json"):
        parse_json(text, "x.json")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="no device has this name")
def test_the_mark_of_an_editor_is_skipped():
    assert parse_json(b'\xef\xbb\xbf{"a": 1}', "x.json") == {"a": 1}
    assert parse_toml(b"\xef\xbb\xbfa = 1\n", "x.toml") == {"a": 1}


def test_devices_are_refused():
    with pytest.raises(ValueError, match="device or pipe"):
        read_bytes("/dev/zero")


def test_large_files_and_folders_are_refused(tmp_path):
    with pytest.raises(ValueError, match="a folder"):
        read_bytes(tmp_path)
    (tmp_path / "large").write_bytes(b"x" * 11)
    with pytest.raises(ValueError, match="at most 10 bytes"):
        read_bytes(tmp_path / "large", most=10)


TASK = """
scene = "scene.toml"
prior = "prior.toml"
effects = ["drag"]
[[conditions]]
name = "low"
at = { "start.height" = 0.01 }
use = "fit"
recordings = ["0.png", "1.png", "2.png"]
"""


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('at = { "start.height" = 0.01 }', "at = 5", r"conditions\[0\].at must be a table"),
        ('use = "fit"', 'use = "fit"\nknown = 5', r"conditions\[0\].known must be a table"),
        ("effects =", "nuisances = 5\neffects =", "nuisances must be a table"),
        (
            "effects =",
            'nuisances = { "tilt.x" = { sd = 1, shred = true } }\neffects =',
            r"nuisances.tilt.x.shred must be absent, .*\(is it shared\?\)",
        ),
        (
            "effects =",
            'reading = { region = [1, "2"] }\neffects =',
            r"region\[1\] must be a number",
        ),
        ("effects =", 'between = "false"\neffects =', "between must be true or false, got 'false'"),
        ('effects = ["drag"]', "effects = []", "effects must be a list of at least 1"),
        ('use = "fit"', 'use = "fit"\naveraged = 1', "averaged must be true or false"),
        ('"1.png"', '"0.png"', "each pour counts once"),
        ('"1.png"', '"../PLACE/0.png"', "each pour counts once"),
        ('scene = "scene.toml"', "scene = 3", "scene must be text"),
        ("[[conditions]]", "[conditions]", "conditions must be a list"),
    ],
)
def test_tasks_are_refused_by_name(tmp_path, old, new, said):
    (tmp_path / "scene.toml").write_text(gc.Scene.drop(0.01, count=12).to_toml())
    (tmp_path / "prior.toml").write_text(gc.Prior.default().to_toml())
    for i in range(3):
        (tmp_path / f"{i}.png").write_bytes(b"\x89PNG")
    path = tmp_path / "loop.toml"
    path.write_text(TASK)
    Task.load(path)
    path.write_text(TASK.replace(old, new.replace("PLACE", tmp_path.name)))
    with pytest.raises(ObservationError, match=said):
        Task.load(path)


def test_a_byte_order_mark_is_no_part_of_a_document(tmp_path):
    """Editors of Windows begin a file with one."""
    (tmp_path / "scene.toml").write_text(gc.Scene.drop(0.01, count=12).to_toml(), "utf-8-sig")
    (tmp_path / "prior.toml").write_text(gc.Prior.default().to_toml(), "utf-8-sig")
    lens = "width = 64\nheight = 48\nfx = 60.0\nfy = 60.0\ncx = 31.5\ncy = 23.5\n"
    (tmp_path / "camera.toml").write_text(lens, "utf-8-sig")
    for i in range(3):
        (tmp_path / f"{i}.png").write_bytes(b"\x89PNG")
    (tmp_path / "loop.toml").write_text(TASK, "utf-8-sig")
    assert Task.load(tmp_path / "loop.toml").prior == gc.Prior.default()
    assert gc.Camera.load(tmp_path / "camera.toml", height=0.3) is not None
    assert parse_json(b"\xef\xbb\xbf[1]", "a.json") == [1]


def test_a_file_name_is_no_scene(tmp_path):
    with pytest.raises(TypeError, match="scene must be a Scene"):
        gc.simulate("scene.toml")  # pyright: ignore[reportArgumentType]
    with pytest.raises(TypeError, match="scene must be a Scene"):
        gc.generate("scene.toml", gc.Prior.default(), 3)  # pyright: ignore[reportArgumentType]


def test_every_document_is_read_through_one_place():
    package = Path(gc.__file__).parent
    # What these parse is text that this program has just made, or checked beforehand.
    allowed = {"documents.py", "prior.py", "damage.py", "camera.py", "samples.py", "asked.py"}
    allowed |= {"scene.py"}
    for path in package.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if path.name not in allowed and "experiments" not in path.parts:
            assert "json.loads(" not in text and "tomllib.loads(" not in text, path


def test_marks_and_lenses_that_are_damaged_are_no_traceback(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("GRANULCAL_CACHE", str(tmp_path))
    folder = tmp_path / "models" / "funnel"
    folder.mkdir(parents=True)
    for text in ("[]", "{", "0", '"fingerprint"', '{"fingerprint": 3}', "\x00"):
        (folder / "made.json").write_text(text)
        # One that ships may be found, the damaged one is not.
        assert find_model("funnel") != folder
    place = tmp_path / "start"
    assert main(["init", str(place), "--scene", "drop", "--set", "grains.count=12"]) == 0
    camera = place / "camera.toml"
    whole = camera.read_text()
    for text in ("", "fx = 1\n", whole.replace("fx =", 'fx = "a" #'), "[["):
        camera.write_text(text)
        assert main(["sample", str(place)]) == 2
        assert "camera.toml" in capsys.readouterr().err


def test_a_task_tells_nothing_of_a_file_that_is_none_of_its_own(tmp_path, capsys):
    secret = tmp_path / "passwd"
    secret.write_text("root:x:0:0:secret:/root:/bin/sh\n")
    (tmp_path / "scene.toml").write_text(gc.Scene.drop(0.01, count=12).to_toml())
    (tmp_path / "prior.toml").write_text(gc.Prior.default().to_toml())
    for i in range(3):
        (tmp_path / f"{i}.png").write_bytes(b"\x89PNG")
    task = tmp_path / "loop.toml"
    for old in ('"scene.toml"', '"prior.toml"'):
        task.write_text(TASK.replace(old, '"passwd"'))
        assert main(["close-loop", str(task), "-o", str(tmp_path / "loop")]) == 2
        error = capsys.readouterr().err
        assert "passwd" in error and "secret" not in error, error


def test_messages_steer_no_terminal_and_fill_none(tmp_path, capsys):
    name = tmp_path / "\x1b[2Jscene.toml"
    name.write_text("x = " + "[" * 9000)
    assert main(["calibrate", str(name), "default", str(name), "-o", str(tmp_path / "o")]) == 2
    error = capsys.readouterr().err
    assert "\x1b" not in error and len(error) < 5000, error[:300]


def test_what_is_misspelt_is_told_before_what_is_missing() -> None:
    table = Table({"recordings": Text()}, {"use": Text()})
    told = r"recording must be absent, for it is unknown \(is it recordings\?\): it has recordings"
    with pytest.raises(ValueError, match=told):
        check({"recording": "a.png"}, table, "task.toml")
    with pytest.raises(ValueError, match="colour must be absent, for it is unknown: it has"):
        check({"colour": "red"}, table, "task.toml")
    assert meant("darg", ["drag", "tilt.x"]) == " (is it drag?)" and meant("darg", []) == ""
