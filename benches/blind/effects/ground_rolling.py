"""A ground on which grains roll worse than on each other, as on velvet: mu_rw = strength mu_r."""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def roughen(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup whose ground has `strength` times the grains' rolling friction."""
    rolling = strength * setup.ground.wall_rolling_friction
    return replace(setup, ground=replace(setup.ground, wall_rolling_friction=rolling))


EFFECT = Effect(name="ground_rolling", unit="mu_rw/mu_r", strengths=(1.5, 2.5, 5.0), apply=roughen)
