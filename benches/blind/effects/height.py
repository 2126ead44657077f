"""A funnel that hangs higher than the recording says, by `strength` mm at every height."""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def raise_funnel(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with funnel and grains `strength` mm higher."""
    rise = 1e-3 * strength
    funnel = replace(setup.funnel, height=setup.funnel.height + rise)
    return replace(setup, funnel=funnel, centres=setup.centres + np.array([0.0, 0.0, rise]))


EFFECT = Effect(name="height", unit="mm", strengths=(4.0, 9.0, 18.0), apply=raise_funnel)
