"""Grains as tables of points that say nothing of an engine: VTK for ParaView, PLY for Blender, CSV."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.export.mark import MARK, is_marked

__all__ = ["ENDINGS", "is_frame", "points_text"]

Array = NDArray[np.float64]
ENDINGS = {"vtk": ".vtk", "ply": ".ply", "csv": ".csv"}
"""Formats of points, and how their files end."""
# How a CSV of them begins, which has no comments.
_NUMBERED = b"number,x,y,z,radius,vx,vy,vz"


def points_text(
    kind: str,
    centres: Array,
    radii: Array,
    *,
    numbers: NDArray[np.int64] | None = None,
    velocities: Array | None = None,
) -> str:
    """Returns grains as text of a file.

    Args:
        kind: one of ENDINGS.
        centres: [m], shape (n, 3).
        radii: [m], shape (n,).
        numbers: of the grains at the start, shape (n,); left out if None.
        velocities: [m/s], shape (n, 3); left out if None.
    """
    named = {name: centres[:, i] for i, name in enumerate("xyz")} | {"radius": radii}
    if velocities is not None:
        named |= {f"v{name}": velocities[:, i] for i, name in enumerate("xyz")}
    if kind == "vtk":
        return _vtk(centres, radii, numbers, velocities)
    rows = [" ".join(f"{v:.9g}" for v in row) for row in zip(*named.values(), strict=True)]
    names = list(named)
    if numbers is not None:
        rows = [f"{number} {row}" for number, row in zip(numbers, rows, strict=True)]
        names.insert(0, "number")
    if kind == "csv":
        return "\n".join([",".join(names), *(row.replace(" ", ",") for row in rows)]) + "\n"
    head = ["ply", "format ascii 1.0", f"comment grains, lengths in metres, {MARK}"]
    head += [f"element vertex {len(radii)}"]
    kinds = {"number": "int"}
    head += [f"property {kinds.get(name, 'double')} {name}" for name in names] + ["end_header"]
    return "\n".join([*head, *rows]) + "\n"


def is_frame(path: Path) -> bool:
    """Returns whether a file is one that `points_text` made with the grains' numbers.

    Raises:
        OSError: it cannot be read.
    """
    if path.suffix != ".csv":
        return is_marked(path)
    with path.open("rb") as file:
        return file.read(len(_NUMBERED)) == _NUMBERED


def _vtk(
    centres: Array, radii: Array, numbers: NDArray[np.int64] | None, velocities: Array | None
) -> str:
    """Returns legacy VTK of points with radii; ParaView draws them by Glyph, scaled by radius."""
    n = len(radii)
    lines = ["# vtk DataFile Version 3.0", f"grains [m], {MARK}", "ASCII", "DATASET POLYDATA"]
    lines += [f"POINTS {n} double", *_rows(centres)]
    lines += [f"VERTICES {n} {2 * n}", *(f"1 {i}" for i in range(n))]
    lines += [f"POINT_DATA {n}", "SCALARS radius double 1", "LOOKUP_TABLE default"]
    lines += [f"{r:.9g}" for r in radii]
    if numbers is not None:
        lines += ["SCALARS number int 1", "LOOKUP_TABLE default", *map(str, numbers)]
    if velocities is not None:
        lines += ["VECTORS velocity double", *_rows(velocities)]
    return "\n".join(lines) + "\n"


def _rows(vectors: Array) -> list[str]:
    return [" ".join(f"{c:.9g}" for c in row) for row in vectors]
