"""Changes numbers of a scene's file and leaves its comments where they are."""

from collections.abc import Mapping
from pathlib import Path

from granulcal.files import replace_file
from granulcal.pours.scene import Scene

__all__ = ["set_numbers", "with_numbers"]


def set_numbers(path: Path, changes: Mapping[str, float | str]) -> Scene:
    """Writes other values into a scene's file and returns the scene; comments stay.

    Args:
        path: TOML of a scene, one key a line.
        changes: values by path, as `Scene.with_` takes them.

    Raises:
        ValueError: a value does not fit the scene, or the file does not state this number.
    """
    # Its errors name the file.
    Scene.load(path)
    text = with_numbers(path.read_text(encoding="utf-8"), changes, path)
    replace_file(path, text)
    return Scene.from_toml(text)


def with_numbers(text: str, changes: Mapping[str, float | str], path: Path) -> str:
    """Returns a scene's TOML with other values; comments stay.

    Args:
        text: of a scene, one key a line.
        changes: values by path, as `Scene.with_` takes them.
        path: its file, for messages.

    Raises:
        ValueError: a value does not fit the scene, or the text does not state this number.
    """
    wanted = Scene.from_toml(text).with_(changes)
    lines = text.splitlines()
    for name, value in changes.items():
        table, _, key = name.rpartition(".")
        lines = _set(path, lines, table, key, value)
    changed = "\n".join(lines) + "\n"
    if Scene.from_toml(changed) != wanted:
        raise ValueError(f"{path} cannot be changed by line: set {', '.join(changes)} by hand")
    return changed


def _set(path: Path, lines: list[str], table: str, key: str, value: float | str) -> list[str]:
    here, result, is_done = "", [], False
    for line in lines:
        bare = line.strip()
        if bare.startswith("[") and not bare.startswith("[["):
            here = bare.strip("[]").strip()
        name, mark, rest = line.partition("=")
        if here == table and mark and name.strip() == key and not bare.startswith("#"):
            comment = rest.find("#")
            tail = "" if comment < 0 else "    " + rest[comment:]
            line, is_done = f"{key} = {_toml(value)}{tail}", True
        result.append(line)
    if not is_done:
        raise ValueError(f"{path} states no {key} in [{table}]; add it there")
    return result


def _toml(value: float | str) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(int(value)) if float(value).is_integer() else repr(float(value))
