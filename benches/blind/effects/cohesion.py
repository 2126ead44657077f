"""Liquid bridges between grains (Willett et al. 2000, equal spheres).

F(S) = F_0 / (1 + 1.05 s + 2.5 s^2), s = S sqrt(R / V_b), up to the rupture at V_b^(1/3); F_0 while
the grains touch. Every gap below the rupture holds a bridge, whether or not the grains have met;
the walls are dry. The strength is Bo = F_0 / (m g), water on these grains at full wetting has 2.
"""

import math
from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect

VOLUME = 0.005
"""Volume of a bridge over R^3 [-]."""


def bridges(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with bridges of Bond number `strength`."""
    radius = float(setup.radii[0])
    volume, touch = VOLUME * radius**3, 2.0 * radius
    slope, root = math.sqrt(radius / volume), math.sqrt(4.0 * 2.5 - 1.05**2)
    # The energy of the bridge, whose derivative is F: LAMMPS differentiates it.
    angle = f"atan((5*{slope}*(r-{touch})+1.05)/{root})-{math.atan(1.05 / root)}"
    gap = f"{2.0 / (root * slope)}*({angle})"
    energy = f"{strength * setup.weight}*select(step(r-{touch}),{gap},r-{touch})"
    cutoff = touch + volume ** (1.0 / 3.0)
    return replace(setup, pair=(f"lepton {cutoff}", f'lepton "{energy}"'))


EFFECT = Effect(name="cohesion", unit="F/mg", strengths=(0.7, 2.0, 5.0), apply=bridges)
