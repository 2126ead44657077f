"""The same pour in LIGGGHTS: equal spheres of one law, without any effect.

Contacts are those of benches/peers/liggghts.py. The funnel is a mesh of `SIDES` sides whose corners
lie on the cone and on the stem.
"""

import math
from itertools import pairwise

import liggghts
import numpy as np
from engine import (
    BOX,
    EARLIEST,
    HORIZON,
    MAY_MOVE,
    SLOW,
    VIEW,
    Funnel,
    Pile,
    Setup,
    Stiffness,
    pile_of,
)
from liggghts import ROLLING

__all__ = ["ROLLING", "pour", "triangles"]

SIDES = 64
"""Of the funnel."""


def triangles(funnel: Funnel) -> np.ndarray:
    """Returns the funnel's surface [m], shape (4 SIDES, 3, 3)."""
    angle = 2.0 * math.pi * np.arange(SIDES + 1) / SIDES
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    profile = (
        (funnel.stem_radius, funnel.height),
        (funnel.stem_radius, funnel.neck),
        (funnel.rim_radius, funnel.rim),
    )
    rings = [np.column_stack([r * around, np.full(len(around), z)]) for r, z in profile]
    found = []
    for low, high in pairwise(rings):
        for i in range(SIDES):
            found += [
                (low[i], low[i + 1], high[i]),
                (low[i + 1], high[i + 1], high[i]),
            ]
    return np.array(found)


def pour(setup: Setup, rolling: str) -> Pile:
    """Returns the pile that LIGGGHTS makes of `setup`; `rolling` is one of `ROLLING`.

    Raises:
        ValueError: spheres of several sizes, several laws, or an effect.
    """
    effects = (setup.clump, setup.pair, setup.force, setup.shake)
    one_law = setup.grains == setup.ground == setup.walls
    if (
        np.ptp(setup.radii) > 0
        or not one_law
        or setup.commands
        or any(e is not None for e in effects)
    ):
        raise ValueError("LIGGGHTS pours equal spheres of one law here, without an effect")
    stiffness = Stiffness.of(setup)
    what = liggghts.Input(
        centres=setup.centres,
        radius=stiffness.radius,
        density=setup.density,
        law=setup.grains,
        young=stiffness.young,
        dt=stiffness.dt,
        triangles=triangles(setup.funnel),
        half_width=BOX,
        top=0.4,
        horizon=HORIZON,
        rolling=rolling,
    )
    looks, cpu = liggghts.pour(what, _is_at_rest)
    centres = looks[-1][:, :3]
    radii = np.full(len(centres), stiffness.radius)
    return pile_of(setup, centres, radii, (len(looks) - 1) * liggghts.LOOK, cpu)


def _is_at_rest(time: float, look: np.ndarray) -> bool:
    """Whether nothing in view moves, as for the pours in LAMMPS."""
    in_view = (np.abs(look[:, :2]) < VIEW).all(axis=1)
    fast = np.linalg.norm(look[:, 3:], axis=1) > SLOW
    return time > EARLIEST and int((fast & in_view).sum()) <= MAY_MOVE
