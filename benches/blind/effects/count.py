"""Fewer grains than the scene says: the share `strength` is missing, from the top."""

from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect


def remove(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup without the share `strength` of its grains."""
    keep = round((1.0 - strength) * len(setup.radii))
    return replace(setup, centres=setup.centres[:keep], radii=setup.radii[:keep])


EFFECT = Effect(name="count", unit="share missing", strengths=(0.1, 0.2, 0.35), apply=remove)
