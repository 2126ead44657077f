"""A slick ground: mu_sw = strength mu_s."""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def polish(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup whose ground has `strength` times the grains' sliding friction."""
    sliding = strength * setup.ground.sliding_friction
    return replace(setup, ground=replace(setup.ground, sliding_friction=sliding))


EFFECT = Effect(name="ground_sliding", unit="mu_sw/mu_s", strengths=(0.8, 0.6, 0.4), apply=polish)
