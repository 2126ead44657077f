r"""How deep elastic grains go into the ground where they land, and how stiff they must be for less.

Hertz' contact without a dashpot turns the energy m* v^2 / 2 of an impact into 8/15 E* sqrt(R*)
delta^(5/2) of its spring at the largest overlap (Johnson 1985, Contact Mechanics, section 11.4), so

    delta = (15 m* v^2 / (16 E* sqrt(R*)))^(2/5),    E* = E / (2 (1 - nu^2))

of two bodies of one Young's modulus. At the ground m* = m and R* = R, and with m = 4/3 pi rho R^3

    delta / R = (5 pi rho v^2 / (4 E*))^(2/5),

whatever the radius. Two grains that meet at v go 0.87 of that into each other. A dashpot leaves less.
"""

import math
from dataclasses import dataclass

import numpy as np

from granulcal.export.law import LARGEST_YOUNG, POISSON
from granulcal.export.setup import Setup

__all__ = ["DEEP", "DeepContactWarning", "Landing"]

DEEP = 0.25
"""From this overlap on, in radii, grains are told to be too soft for how they fall [-].

That of 3 MPa after half a metre. At half of it piles are 2 % wider than of ten times as stiff
grains (docs/export.md), and no run here went deeper.
"""


class DeepContactWarning(UserWarning):
    """Elastic grains fall so fast that they go deep into what they land on."""


@dataclass(frozen=True)
class Landing:
    """The fastest landing that a start allows.

    Attributes:
        speed: after the fall of the highest grain to the ground, without a funnel's friction [m/s].
        overlap: the largest of that landing, in radii of the grain [-].
        young: Young's modulus of the grains [Pa].
    """

    speed: float
    overlap: float
    young: float

    @classmethod
    def of(cls, setup: Setup, young: float) -> "Landing":
        """Returns the landing of grains of a Young's modulus [Pa]."""
        highest = int(np.argmax(setup.centres[:, 2]))
        fall = max(float(setup.centres[highest, 2] - setup.radii[highest]), 0.0)
        square = 2.0 * float(np.linalg.norm(setup.gravity)) * fall
        effective = young / (2.0 * (1.0 - POISSON**2))
        overlap = (5.0 * math.pi * setup.density * square / (4.0 * effective)) ** 0.4
        return cls(math.sqrt(square), overlap, young)

    @property
    def is_deep(self) -> bool:
        """Whether the grains are too soft for their fall."""
        return self.overlap > DEEP

    @property
    def enough(self) -> float:
        """The Young's modulus of an overlap of DEEP, two digits, rounded up [Pa]."""
        needed = self.young * (self.overlap / DEEP) ** 2.5
        if needed <= 0.0:
            return 0.0
        unit = 10.0 ** (math.floor(math.log10(needed)) - 1)
        return float(f"{math.ceil(needed / unit) * unit:.2g}")

    def told(self) -> str:
        """Returns the landing in words, and what makes it shallower where it is deep."""
        landing = (
            f"grains of {self.young:.3g} Pa that fall from the start's highest place land at "
            f"{self.speed:.3g} m/s and go {self.overlap:.2f} of a radius into the ground (Hertz)"
        )
        if not self.is_deep:
            return landing
        if self.enough > LARGEST_YOUNG:
            return f"{landing}; no Young's modulus that is allowed makes that {DEEP:g}"
        slower = math.sqrt(self.enough / self.young)
        return (
            f"{landing}; a Young's modulus (--young) of {self.enough:.2g} Pa makes that {DEEP:g}, at time "
            f"steps {slower:.2g} times as short"
        )
