"""Grains as engines write them: LAMMPS dumps, CSV, npy."""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import read_array
from granulcal.documents import ENCODING, read_bytes

__all__ = ["read_grains"]

Array = NDArray[np.float64]
NAMES = ("grains.npy", "grains.csv", "grains.dump")
"""Where grains may stand, the first that is there."""
_PLACES = ("x", "y", "z")


def read_grains(folder: Path, radius: float | None = None) -> tuple[Array, Array] | None:
    """Returns centres [m] (n, 3) and radii [m] (n,) in a folder, None if there is no such file.

    Args:
        folder: with one of grains.npy (x, y, z and perhaps radius), grains.csv (the same, in the
            order that its first line names) or grains.dump (of LAMMPS, columns id, x, y, z, radius).
        radius: of all grains, where the file states none [m].

    Raises:
        ValueError: a file of another form.
    """
    for name in NAMES:
        path = folder / name
        if path.exists():
            table = _table(path)
            if table.ndim != 2 or table.shape[1] not in (3, 4):
                raise ValueError(f"{path} must have x, y, z and perhaps radius, got {table.shape}")
            if table.shape[1] == 3 and radius is None:
                raise ValueError(f"{path} states no radius")
            radii = table[:, 3] if table.shape[1] == 4 else np.full(len(table), radius)
            return np.ascontiguousarray(table[:, :3]), np.ascontiguousarray(radii, dtype=float)
    return None


def _table(path: Path) -> Array:
    if path.suffix == ".npy":
        return read_array(path)
    if path.suffix == ".csv":
        return _csv(path)
    return _dump(path)


def _csv(path: Path) -> Array:
    """Returns x, y, z and perhaps radius by the names in the first line."""
    text = read_bytes(path).decode(ENCODING, "replace")
    first, _, rest = text.lstrip().partition("\n")
    names = [word.strip(" \t\r\"'").lower() for word in first.lstrip("# ").split(",")]
    wanted = [*_PLACES, "radius"] if "radius" in names else list(_PLACES)
    if set(wanted) - set(names) or len(set(names)) < len(names):
        raise ValueError(
            f"{path}: its first line must name the columns x, y, z and perhaps radius, "
            f"got {first.strip()[:80]!r}"
        )
    if not rest.strip():
        return np.empty((0, len(wanted)))
    _require_columns(path, rest, len(names))
    columns = [names.index(name) for name in wanted]
    try:
        return np.loadtxt(io.StringIO(rest), delimiter=",", usecols=columns, ndmin=2)
    except ValueError as error:
        raise ValueError(f"{path}: not a table of numbers: {error}") from None


def _require_columns(path: Path, rows: str, count: int) -> None:
    """Refuses rows with more numbers than there are names: with decimal commas each is two."""
    for number, row in enumerate(rows.splitlines(), start=2):
        found = len(row.partition("#")[0].rstrip(", \t").split(","))
        if found > count:
            raise ValueError(
                f"{path}: line {number} must have {count} numbers with decimal points, commas "
                f"between; got {found}"
            )


def _dump(path: Path) -> Array:
    """Returns the last frame of a LAMMPS dump, in the order of the ids."""
    text = read_bytes(path).decode("utf-8", "replace")
    head = text.rfind("ITEM: ATOMS")
    if head < 0:
        raise ValueError(f"{path} is no LAMMPS dump: it has no line ITEM: ATOMS")
    first, *rows = text[head:].splitlines()
    names = first.split()[2:]
    missing = {"id", "x", "y", "z", "radius"} - set(names)
    if missing:
        raise ValueError(f"{path} must have the columns id, x, y, z, radius; it has {names}")
    try:
        table = np.array([row.split() for row in rows], float).reshape(len(rows), len(names))
    except ValueError as error:
        raise ValueError(f"{path}: a row has not {len(names)} numbers: {error}") from None
    table = table[np.argsort(table[:, names.index("id")])]
    return table[:, [names.index(name) for name in ("x", "y", "z", "radius")]]
