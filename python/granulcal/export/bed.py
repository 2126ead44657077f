"""Grains at one time as files that other programs read: LAMMPS data, VTK, PLY, CSV, MJCF, SDF, URDF."""

import math

import numpy as np
from numpy.typing import NDArray

from granulcal.export import gazebo, lammps, mujoco
from granulcal.export.mark import MARK, signed
from granulcal.export.setup import Setup

__all__ = ["FORMATS", "bed_text"]

Array = NDArray[np.float64]
FORMATS = {
    "lammps-data": ".data",
    "vtk": ".vtk",
    "ply": ".ply",
    "csv": ".csv",
    "mjcf": ".xml",
    "sdf": ".sdf",
    "urdf": ".urdf",
}
"""Formats of a bed, and how their files end."""


def bed_text(setup: Setup, kind: str) -> str:
    """Returns the grains of `setup` as text of a file.

    Args:
        setup: the pour, its centres and radii those of the bed.
        kind: one of FORMATS.

    Raises:
        ValueError: another format.
    """
    makers = {
        "lammps-data": lambda: lammps.data(setup),
        "vtk": lambda: _vtk(setup.centres, setup.radii),
        "ply": lambda: _ply(setup.centres, setup.radii),
        "csv": lambda: _csv(setup.centres, setup.radii),
        "mjcf": lambda: mujoco.mjcf(setup),
        "sdf": lambda: gazebo.scene(setup)["pour.sdf"],
        "urdf": lambda: _urdf(setup),
    }
    if kind not in makers:
        raise ValueError(f"a bed is written as one of {', '.join(FORMATS)}, got {kind!r}")
    return makers[kind]()


def _vtk(centres: Array, radii: Array) -> str:
    """Returns legacy VTK of points with their radii; ParaView draws them by Glyph, scaled by radius."""
    n = len(radii)
    lines = ["# vtk DataFile Version 3.0", f"grains [m], {MARK}", "ASCII", "DATASET POLYDATA"]
    lines += [f"POINTS {n} double", *(" ".join(f"{c:.9g}" for c in at) for at in centres)]
    lines += [f"VERTICES {n} {2 * n}", *(f"1 {i}" for i in range(n))]
    lines += [f"POINT_DATA {n}", "SCALARS radius double 1", "LOOKUP_TABLE default"]
    return "\n".join([*lines, *(f"{r:.9g}" for r in radii)]) + "\n"


def _ply(centres: Array, radii: Array) -> str:
    head = ["ply", "format ascii 1.0", f"comment grains, lengths in metres, {MARK}"]
    head += [f"element vertex {len(radii)}"]
    head += [f"property double {name}" for name in ("x", "y", "z", "radius")] + ["end_header"]
    rows = (" ".join(f"{v:.9g}" for v in (*at, r)) for at, r in zip(centres, radii, strict=True))
    return "\n".join([*head, *rows]) + "\n"


def _csv(centres: Array, radii: Array) -> str:
    rows = (",".join(f"{v:.9g}" for v in (*at, r)) for at, r in zip(centres, radii, strict=True))
    return "\n".join(["x,y,z,radius", *rows]) + "\n"


def _urdf(setup: Setup) -> str:
    """Returns URDF of floating grains; it states no gravity and no friction of rolling."""
    parts = [
        '<?xml version="1.0"?>',
        f"<!-- {signed(setup.name, 'urdf')} -->",
        f'<robot name="{setup.name}">',
        '<link name="world"/>',
    ]
    for i, (centre, r) in enumerate(zip(setup.centres, setup.radii, strict=True)):
        mass = setup.density * 4.0 / 3.0 * math.pi * r**3
        moment = 0.4 * mass * r * r
        at = " ".join(f"{c:.9g}" for c in centre)
        ball = f'<geometry><sphere radius="{r:.9g}"/></geometry>'
        parts.append(
            f'<link name="grain{i}"><inertial><mass value="{mass:.6g}"/>'
            f'<inertia ixx="{moment:.6g}" iyy="{moment:.6g}" izz="{moment:.6g}" ixy="0" ixz="0" iyz="0"/>'
            f"</inertial><visual>{ball}</visual><collision>{ball}</collision></link>"
            f'<joint name="free{i}" type="floating"><parent link="world"/><child link="grain{i}"/>'
            f'<origin xyz="{at}"/></joint>'
        )
    return "\n".join([*parts, "</robot>"]) + "\n"
