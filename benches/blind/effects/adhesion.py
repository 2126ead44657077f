"""Dry adhesion between grains: a constant pull-off force, as of DMT and JKR grains that are stiff.

F = F_0 while the grains touch, falling linearly to 0 over a gap of 40 um; the walls do not attract.
The strength is Bo = F_0 / (m g).
"""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect

REACH = 4e-5
"""Gap at which the attraction ends [m]."""


def attract(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with a pull-off force of `strength` weights."""
    touch = 2.0 * float(setup.radii[0])
    gap = f"(r-{touch})*(1-0.5*(r-{touch})/{REACH})"
    energy = f"{strength * setup.weight}*select(step(r-{touch}),{gap},r-{touch})"
    return replace(setup, pair=(f"lepton {touch + REACH}", f'lepton "{energy}"'))


EFFECT = Effect(name="adhesion", unit="F/mg", strengths=(0.5, 1.5, 4.0), apply=attract)
