"""Files that are whole or absent."""

import os
from pathlib import Path

__all__ = ["write_beside"]


def write_beside(path: Path, text: str) -> None:
    """Writes a whole file or none."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    beside.write_text(text, encoding="utf-8")
    os.replace(beside, path)
