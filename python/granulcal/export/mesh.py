"""Walls as triangles: for engines that have no cones, and for the eye."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.export.mark import MARK

__all__ = ["Mesh", "stl", "triangles"]

Array = NDArray[np.float64]
_SIDES = 64
# How far a plane that is no ground reaches [m].
_PLANE = 1.0
_BOX_SIDES = {
    f"{letter}_{end}": (axis, k)
    for axis, letter in enumerate("xyz")
    for k, end in enumerate(("min", "max"))
}


@dataclass(frozen=True)
class Mesh:
    """Triangles.

    Attributes:
        vertices: [m], shape (n, 3).
        faces: three vertices each, shape (m, 3).
    """

    vertices: Array
    faces: NDArray[np.int64]

    @classmethod
    def joined(cls, meshes: "list[Mesh]") -> "Mesh":
        """Returns several as one."""
        offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
        return cls(
            np.concatenate([mesh.vertices for mesh in meshes]),
            np.concatenate([mesh.faces + o for mesh, o in zip(meshes, offsets, strict=True)]),
        )


def triangles(shape: dict[str, Any], *, sides: int = _SIDES) -> Mesh:
    """Returns the triangles of a scene's wall; round ones have `sides` sides, inside the true wall.

    Args:
        shape: its table: kind and lengths [m].
        sides: of a circle.

    Raises:
        ValueError: a kind that has no triangles of its own.
    """
    kind = shape["kind"]
    if kind == "plane":
        return _square(shape["point"], shape["normal"])
    if kind == "disc":
        centre, normal = np.asarray(shape["centre"], float), np.asarray(shape["normal"], float)
        return _cap(_ring(centre, normal, float(shape["radius"]), sides), centre)
    if kind in ("cone", "cylinder"):
        return _shell(shape, sides)
    if kind == "box":
        return _box(shape)
    raise ValueError(f"a wall of kind {kind!r} has no triangles to export")


def stl(mesh: Mesh, name: str) -> str:
    """Returns a mesh as text of an STL file [m]."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    lines = [f"solid {name} {MARK}"]
    for normal, triangle in zip(normals, corners, strict=True):
        lines += ["facet normal {:.9g} {:.9g} {:.9g}".format(*normal), "outer loop"]
        lines += ["vertex {:.9g} {:.9g} {:.9g}".format(*corner) for corner in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, f"endsolid {name}"]) + "\n"


def _frame(axis: Array) -> tuple[Array, Array]:
    """Returns two unit vectors across an axis."""
    axis = axis / np.linalg.norm(axis)
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    u = np.asarray(np.cross(axis, helper), float)
    u /= np.linalg.norm(u)
    return u, np.asarray(np.cross(axis, u), float)


def _ring(centre: Array, axis: Array, radius: float, sides: int) -> Array:
    u, v = _frame(axis)
    angle = 2 * np.pi * np.arange(sides) / sides
    return centre + radius * (np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * v)


def _cap(ring: Array, centre: Array) -> Mesh:
    i = np.arange(len(ring))
    hub = np.full(len(ring), len(ring))
    return Mesh(np.vstack([ring, centre]), np.stack([i, (i + 1) % len(ring), hub], axis=1))


def _shell(shape: dict[str, Any], sides: int) -> Mesh:
    low, high = np.asarray(shape["from"], float), np.asarray(shape["to"], float)
    names = ("radius_from", "radius_to") if shape["kind"] == "cone" else ("radius", "radius")
    radii = [float(shape[name]) for name in names]
    axis = high - low
    rings = [_ring(at, axis, r, sides) for at, r in zip((low, high), radii, strict=True)]
    i = np.arange(sides)
    after = (i + 1) % sides
    faces = np.concatenate(
        [np.stack([i, after, i + sides], 1), np.stack([after, after + sides, i + sides], 1)]
    )
    parts = [Mesh(np.vstack(rings), faces)]
    closed = shape.get("closed", "none")
    ends = {"none": [], "from": [0], "to": [1], "both": [0, 1]}[closed]
    parts += [_cap(rings[end], (low, high)[end]) for end in ends]
    return Mesh.joined(parts)


def _square(point: Any, normal: Any) -> Mesh:
    u, v = _frame(np.asarray(normal, float))
    at = np.asarray(point, float)
    corners = [at + _PLANE * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    return Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))


def _box(shape: dict[str, Any]) -> Mesh:
    bounds = np.array([shape["min"], shape["max"]], float)
    missing = set(shape.get("open", []))
    parts = []
    for name, (axis, end) in _BOX_SIDES.items():
        if name in missing:
            continue
        others = [k for k in range(3) if k != axis]
        corners = np.empty((4, 3))
        corners[:, axis] = bounds[end, axis]
        for row, (a, b) in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
            corners[row, others] = bounds[a, others[0]], bounds[b, others[1]]
        parts.append(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])))
    return Mesh.joined(parts)
