"""Our contact law in the terms that other engines have: dashpots, lengths, angles.

docs/export.md derives the formulas; LAMMPS' were checked against single impacts by
benches/peers/lammps_impact.py.
"""

import math
from dataclasses import dataclass, fields
from typing import Any

from granulcal.pours.scene import Material

__all__ = [
    "LARGEST_YOUNG",
    "LEAST_WITHOUT_TENSION",
    "LEAST_YOUNG",
    "POISSON",
    "Contact",
    "Stiffness",
    "critical_tangential_damping",
    "damping_ratio",
    "nominal_restitution",
    "pulling_duration",
    "restitution_of",
]

LEAST_WITHOUT_TENSION = math.exp(-2.0)
"""Restitution of the critically damped contact that lets go when its force would pull [-]."""
POISSON = 0.25
"""Poisson's ratio of engines that ask for one [-]; ours has none."""
LEAST_YOUNG, LARGEST_YOUNG = 1e4, 1e12
"""Softer than any gel, and stiffer than diamond [Pa]."""
_LEAST_RESTITUTION = 0.01
# Least e that an engine is told, and -ln of it.
_NOMINAL, _DECREMENT = 1e-100, 100.0 * math.log(10.0)
_RIGID_YOUNG = 3e6
_RIGID_DENSITY = 1300.0
_STEP = 0.2
# A_t / A_n of docs/theory/contact.md.
_TANGENTIAL_INERTIA = 3.5


@dataclass(frozen=True, kw_only=True)
class Contact(Material):
    """Coefficients of a contact, in the terms of other engines."""

    @classmethod
    def of(cls, table: dict[str, Any], default: "Contact | None" = None) -> "Contact":
        """Returns the contact in a scene's table, with what it leaves out from `default`."""
        base = {} if default is None else vars(default)
        known = {field.name for field in fields(cls)}
        stated = {name: float(value) for name, value in table.items() if name in known}
        return cls(**{**base, **stated})

    def rolling_length(self, effective_radius: float) -> float:
        """Returns the lever of the rolling moment, mu_r R_eff [m]."""
        return self.rolling_friction * effective_radius

    def torsional_length(self, effective_radius: float) -> float:
        """Returns the lever of the torsional moment, mu_t R_eff [m]."""
        return self.torsional_friction * effective_radius

    @property
    def friction_angle(self) -> float:
        """Angle of Coulomb's cone, atan(mu_s) [rad]."""
        return math.atan(self.sliding_friction)


@dataclass(frozen=True, kw_only=True)
class Stiffness:
    """What an elastic engine needs and a rigid law does not know, for the smallest grain.

    Attributes:
        radius: of the smallest grain [m].
        mass: of it [kg].
        young: Young's modulus [Pa].
        dt: time step, a fifth of the time of a Rayleigh wave across half of the grain [s].
    """

    radius: float
    mass: float
    young: float
    dt: float

    @classmethod
    def of(cls, radius: float, density: float, young: float | None = None) -> "Stiffness":
        """Returns the stiffness for grains of this radius [m] and density [kg/m^3].

        Without a Young's modulus it is 3 MPa at 1300 kg/m^3, in proportion to the density: at that
        piles from 8 cm differ from those of 10 MPa by less than the spread of seeds. From higher up it is
        too soft; `landing.py` says how deep grains go into the ground.
        """
        modulus = _RIGID_YOUNG * density / _RIGID_DENSITY if young is None else young
        shear = modulus / (2.0 * (1.0 + POISSON))
        wave = 0.1631 * POISSON + 0.8766
        return cls(
            radius=radius,
            mass=density * 4.0 / 3.0 * math.pi * radius**3,
            young=modulus,
            dt=_STEP * math.pi * radius * math.sqrt(density / shear) / wave,
        )


def restitution_of(beta: float) -> float:
    """Returns e of a spring and dashpot that let go as soon as their force would pull [-].

    exp(-2 beta acos(beta) / sqrt(1 - beta^2)), and above critical damping its continuation,
    exp(-2 beta acosh(beta) / sqrt(beta^2 - 1)); exp(-2) at beta = 1.

    Args:
        beta: dashpot over its critical value [-].
    """
    if abs(beta - 1.0) < 1e-9:
        return LEAST_WITHOUT_TENSION
    if beta < 1.0:
        return math.exp(-2.0 * beta * math.acos(beta) / math.sqrt(1.0 - beta * beta))
    return math.exp(-2.0 * beta * math.acosh(beta) / math.sqrt(beta * beta - 1.0))


def damping_ratio(restitution: float, *, tension: bool, overdamped: bool = False) -> float:
    """Returns the dashpot over its critical value that gives the restitution e [-].

    Args:
        restitution: e; below 0.01 it is taken as 0.01.
        tension: whether the dashpot may pull a parting contact: e = exp(-pi beta /
            sqrt(1 - beta^2)). If not, `restitution_of` is solved.
        overdamped: whether the answer may lie above 1, which e < exp(-2) needs without tension.
    """
    wanted = max(restitution, _LEAST_RESTITUTION)
    if tension:
        decrement = -math.log(wanted)
        return decrement / math.hypot(math.pi, decrement)
    low, high = 0.0, 1e3 if overdamped else 1.0
    for _ in range(80):
        beta = 0.5 * (low + high)
        low, high = (beta, high) if restitution_of(beta) > wanted else (low, beta)
    return 0.5 * (low + high)


def pulling_duration(restitution: float) -> float:
    """Returns how long a Hertz contact whose dashpot pulls lasts, over one of ours [-].

    Both counted in the rate of their spring, time sqrt(k / m) with Hertz' secant k. In that time
    Hertz' contact with a dashpot in proportion to the root of its stiffness is a linear one in
    overlap^(5/4), of rate sqrt(5/4): it lasts sqrt((pi^2 + ln^2 e) / (5/4)). Ours lets go after
    -ln(e) / beta.

    Args:
        restitution: e of both; below 0.01 it is taken as 0.01.
    """
    decrement = -math.log(max(restitution, _LEAST_RESTITUTION))
    beta = damping_ratio(restitution, tension=False, overdamped=True)
    ours = decrement / beta if decrement > 1e-9 else math.pi
    return math.hypot(math.pi, decrement) / math.sqrt(1.25) / ours


def nominal_restitution(beta: float) -> float:
    """Returns the e with which an engine that lets dashpots pull takes the damping beta [-].

    Critical damping has none: there it is 1e-100, whose logarithm is still a number.
    """
    root = math.sqrt(max(1.0 - beta * beta, 0.0))
    return math.exp(-math.pi * beta / root) if math.pi * beta < _DECREMENT * root else _NOMINAL


def critical_tangential_damping(beta: float) -> float:
    """Returns tangential over normal dashpot for a critically damped sticking contact [-].

    A critically damped spring does not come back: e_t = 0.
    """
    ratio = 3.0 * (1.0 - POISSON) / (2.0 - POISSON)
    return 2.0 * math.sqrt(ratio / (5.0 * _TANGENTIAL_INERTIA)) / max(beta, 1e-6)
