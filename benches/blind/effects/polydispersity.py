"""Lognormal diameters of coefficient of variation s, with the same count and the same mean volume.

d_i = c exp(sigma xi), sigma^2 = ln(1 + s^2), cut off at both ends, which takes 0.006 of s at the
strongest below; c such that the mean of d_i^3 is d^3.
"""

import math
from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect

LEAST, MOST = 0.4, 1.7
"""Diameters are cut off here, in units of d [-]: what the start's spacing holds."""


def spread(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with diameters of coefficient of variation `strength`."""
    sigma = math.sqrt(math.log1p(strength**2))
    normal = random.standard_normal(len(setup.radii))
    factor = np.exp(sigma * normal - 1.5 * sigma**2).clip(LEAST, MOST)
    return replace(setup, radii=setup.radii * factor / np.cbrt((factor**3).mean()))


EFFECT = Effect(name="polydispersity", unit="sd/mean", strengths=(0.08, 0.16, 0.25), apply=spread)
