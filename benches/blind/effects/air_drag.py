"""Air drag on light grains (Schiller & Naumann 1935), in still air.

F = -3 pi eta d (1 + 0.15 Re^0.687) v. The strength is the drag over the weight at 1.5 m/s, which
decides the density of the grains: weight alone drops out of a dry pour.
"""

import math
from dataclasses import replace

import numpy as np
from engine import Setup

from effects import Effect

VISCOSITY, AIR = 1.82e-5, 1.2
"""Of air: dynamic viscosity [Pa s], density [kg/m3]."""
SPEED = 1.5
"""Speed at which the strength is stated [m/s]."""


def drag(x: np.ndarray, v: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Returns the drag on each sphere [N], shape (n, 3)."""
    speed = np.linalg.norm(v, axis=1)
    reynolds = 2.0 * radii * speed * AIR / VISCOSITY
    return (-6.0 * math.pi * VISCOSITY * radii * (1.0 + 0.15 * reynolds**0.687))[:, None] * v


def slow(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup in air, with grains so light that drag is `strength` of the weight."""
    at_speed = drag(np.zeros((1, 3)), np.array([[SPEED, 0.0, 0.0]]), setup.radii[:1])
    density = setup.density * -at_speed[0, 0] / (strength * setup.weight)
    return replace(setup, density=float(density), force=drag)


EFFECT = Effect(name="air_drag", unit="F/mg at 1.5 m/s", strengths=(0.15, 0.4, 1.0), apply=slow)
