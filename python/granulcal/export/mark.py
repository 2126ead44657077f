"""What tells a file that granulcal exported from one of the user's own, and a name that is text alone."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

__all__ = ["MARK", "is_marked", "plain", "require_ending", "require_replaceable", "signed"]

MARK = "exported by granulcal"
"""Stands in the first lines of every file whose format has comments."""

# Bytes of a file in which the mark is looked for.
_HEAD = 1024
_LONGEST = 80


def plain(name: str) -> str:
    """Returns a name that is neither code nor markup, wherever it is written.

    Letters, digits, `_`, spaces, `.`, `+` and `-` are kept, every other character becomes `_`, dashes
    in a row become one, and 80 characters are the most.
    """
    kept = re.sub(r"[^\w .+-]", "_", name)
    return re.sub("-{2,}", "-", kept)[:_LONGEST].strip() or "scene"


def signed(name: str, engine: str) -> str:
    """Returns the line that says what a file is, and who wrote it for which engine."""
    return f"{plain(name)}, {MARK} for {engine}"


def is_marked(path: Path) -> bool:
    """Returns whether a plain file bears the mark in its first lines.

    Raises:
        OSError: it cannot be read.
    """
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return MARK.encode() in file.read(_HEAD)


def require_replaceable(paths: Iterable[Path]) -> None:
    """Refuses to replace what granulcal did not export; what is absent or empty may be written.

    Raises:
        ValueError: names the first file that is the user's own.
        OSError: it cannot be read.
    """
    for path in paths:
        # Devices, pipes and folders are refused by whoever writes.
        if path.is_file() and path.stat().st_size > 0 and not is_marked(path):
            raise ValueError(
                f"{path} is left as it is: granulcal did not export it; choose another name or "
                "folder, or move it away"
            )


def require_ending(path: Path, kind: str, endings: Mapping[str, str]) -> None:
    """Refuses a name that ends as a file of another kind: whoever opened it would take it for that.

    Args:
        path: the file.
        kind: what it will hold.
        endings: how files of each kind end; of any other ending nothing is said.

    Raises:
        ValueError: names the ending and that of the kind.
    """
    found, own = path.suffix.lower(), endings.get(kind)
    if own is None or found == own or found not in endings.values():
        return
    others = [other for other, ending in endings.items() if ending == found]
    raise ValueError(
        f"{path} ends in {found}, as files of {' and '.join(others)} do, and would hold {kind}: let it end in {own}"
    )
