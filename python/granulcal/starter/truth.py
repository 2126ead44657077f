"""What was poured for the samples of a folder, and which files are these samples: truth.json."""

import json
from collections.abc import Iterable
from pathlib import Path

from granulcal import _native
from granulcal.documents import Mapping, Number, Table, Text, Whole, read_bytes, read_json
from granulcal.files import write_beside

__all__ = ["require_own", "write_truth"]

_NAME = "truth.json"
_SCHEMA = Table(
    {"material": Mapping(Number()), "seed": Whole()}, {"hashes": Mapping(Text())}, open=True
)


def require_own(folder: Path, paths: Iterable[Path]) -> None:
    """Refuses to replace recordings that are not those of the folder's truth.json.

    Raises:
        ValueError: names the first that is no sample or was changed, or a truth.json of another
            kind.
    """
    truth = folder / _NAME
    known = read_json(truth, _SCHEMA).get("hashes", {}) if truth.exists() else {}
    for path in paths:
        stated = known.get(path.relative_to(folder).as_posix())
        if path.exists() and (stated is None or stated != _hash(path)):
            raise ValueError(
                f"{path} is left as it is: it is no sample of {truth}, or was changed; choose "
                "another folder, or move it away"
            )


def write_truth(folder: Path, material: dict[str, float], seed: int, paths: Iterable[Path]) -> None:
    """Writes what was poured, and which files show it."""
    hashes = {path.relative_to(folder).as_posix(): _hash(path) for path in paths}
    truth = {"material": material, "seed": seed, "hashes": hashes}
    write_beside(folder / _NAME, json.dumps(truth, indent=1) + "\n")


def _hash(path: Path) -> str:
    return _native.hash_bytes(read_bytes(path))
