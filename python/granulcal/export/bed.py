"""Grains at one time as files that other programs read: LAMMPS data, VTK, PLY, CSV, MJCF, SDF, URDF."""

import math

from granulcal.export import gazebo, lammps, mujoco
from granulcal.export.mark import signed
from granulcal.export.points import ENDINGS, points_text
from granulcal.export.setup import Setup

__all__ = ["FORMATS", "bed_text"]

FORMATS = {
    "lammps-data": ".data",
    **ENDINGS,
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
    if kind in ENDINGS:
        return points_text(kind, setup.centres, setup.radii)
    makers = {
        "lammps-data": lambda: lammps.data(setup),
        "mjcf": lambda: mujoco.mjcf(setup),
        "sdf": lambda: gazebo.scene(setup)["pour.sdf"],
        "urdf": lambda: _urdf(setup),
    }
    if kind not in makers:
        raise ValueError(f"a bed is written as one of {', '.join(FORMATS)}, got {kind!r}")
    return makers[kind]()


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
