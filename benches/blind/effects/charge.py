"""Equal charges on all grains, which repel each other; the ground is an insulator.

F_ij = q^2 / (4 pi eps_0 r^2), q = strength pi d^2, over all pairs, sampled every 2 ms.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from engine import Setup

from effects import Effect

COULOMB = 8.9875517923e9
"""1 / (4 pi eps_0) [N m2/C2]."""


def repel(x: np.ndarray, v: np.ndarray, radii: np.ndarray, *, q: float) -> np.ndarray:
    """Returns the repulsion of each sphere of charge q [C] by all others [N], shape (n, 3)."""
    apart = x[:, None] - x[None]
    square = np.einsum("ijk,ijk->ij", apart, apart) + np.eye(len(x))
    return COULOMB * q**2 * np.einsum("ijk,ij->ik", apart, square**-1.5)


def charge(setup: Setup, strength: float, random: np.random.Generator) -> Setup:
    """Returns the setup with `strength` uC/m2 on every grain."""
    q = strength * 1e-6 * 4.0 * np.pi * float(setup.radii[0]) ** 2
    return replace(setup, force=partial(repel, q=q), force_interval=2e-3)


EFFECT = Effect(name="charge", unit="uC/m2", strengths=(1.5, 3.0, 5.0), apply=charge)
