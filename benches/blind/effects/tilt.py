"""A table that is not level: gravity turned by `strength` degrees, in a random direction.

Funnel and camera stand at right angles to the table.
"""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def turn(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with gravity turned by `strength` degrees."""
    tilt, towards = np.radians(strength), random.uniform(0.0, 2.0 * np.pi)
    along = [np.sin(tilt) * np.cos(towards), np.sin(tilt) * np.sin(towards), -np.cos(tilt)]
    return replace(setup, gravity=np.linalg.norm(setup.gravity) * np.array(along))


EFFECT = Effect(name="tilt", unit="deg", strengths=(1.0, 2.5, 5.0), apply=turn)
