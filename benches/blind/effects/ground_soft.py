"""A ground that gives less back than the grains: e_w = (1 - strength) e."""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def soften(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup whose ground has lost the share `strength` of the restitution."""
    restitution = (1.0 - strength) * setup.ground.restitution
    return replace(setup, ground=replace(setup.ground, restitution=restitution))


EFFECT = Effect(name="ground_soft", unit="1 - e_w/e", strengths=(0.3, 0.6, 0.95), apply=soften)
