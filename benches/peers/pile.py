"""What the engines' piles are compared by."""

import numpy as np
from lammps_contact import RADIUS

HALF_WIDTH = 0.8
"""Grains that roll farther than this along x or y leave LAMMPS' box and are not counted [m]."""
TIP = 0.12
"""Height of the funnel's tip [m]."""


def measure(centres: np.ndarray) -> dict[str, float]:
    """Returns the measures of a pile: lengths in mm over centres (`max_z`: the top), `held` grains.

    Args:
        centres: centres of the grains at rest [m], shape (n, 3).
    """
    inside = (np.abs(centres[:, :2]) < HALF_WIDTH).all(axis=1)
    x = 1e3 * centres[inside]
    r = np.hypot(*(x[:, :2] - x[:, :2].mean(axis=0)).T)
    return {
        "max_z": x[:, 2].max() + 1e3 * RADIUS,
        "mean_z": x[:, 2].mean(),
        "mean_r": r.mean(),
        "r95": np.quantile(r, 0.95),
        "held": int((x[:, 2] > 1e3 * TIP).sum()),
    }
