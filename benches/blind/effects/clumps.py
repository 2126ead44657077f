"""Grains that are no spheres: rigid pairs of equal spheres, as many as the scene has grains.

The strength is length over breadth, A. Spheres of diameter b whose centres are (A - 1) b apart; b
is such that the pair has a grain's volume. LAMMPS takes mass and inertia as the sum of
two whole spheres, the overlap twice: mass drops out of a dry pour, and the inertia is up to a fifth
from that of the body of uniform density.
"""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def join(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with pairs of length over breadth `strength` in random directions."""
    apart = strength - 1.0  # In units of b; two caps of height (1 - apart) b / 2 overlap.
    cap = 0.5 * max(0.0, 1.0 - apart)
    overlap = 2.0 * cap**2 * (1.5 - cap) / 3.0  # Over pi b^3; a sphere has 1/6.
    shrink = (2.0 - 6.0 * overlap) ** (-1.0 / 3.0)
    radii = setup.radii * shrink
    axis = random.standard_normal((len(radii), 3))
    axis *= (radii * apart / np.linalg.norm(axis, axis=1))[:, None]
    centres = np.concatenate([setup.centres - axis, setup.centres + axis])
    body = np.arange(1, len(radii) + 1)
    return replace(setup, centres=centres, radii=np.tile(radii, 2), clump=np.tile(body, 2))


EFFECT = Effect(name="clumps", unit="length/breadth", strengths=(1.2, 1.5, 1.9), apply=join)
