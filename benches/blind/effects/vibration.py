"""A table that vibrates for 0.3 s after the pour, at 30 Hz: strength = amplitude omega^2 / g."""

import math
from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect

FREQUENCY, DURATION = 30.0, 0.3
"""Of the vibration [Hz], [s]."""


def shake(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup on a table that is shaken with `strength` g."""
    amplitude = strength * 9.81 / (2.0 * math.pi * FREQUENCY) ** 2
    return replace(setup, shake=(amplitude, FREQUENCY, DURATION))


EFFECT = Effect(name="vibration", unit="g", strengths=(1.2, 2.0, 3.0), apply=shake)
