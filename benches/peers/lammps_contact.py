"""Our contact law (docs/theory/contact.md) in the terms of LAMMPS' granular models.

LAMMPS' grains are elastic: Hertz along the normal, Mindlin across it, springs and dashpots for
rolling and torsion. docs/results/peers.md says what of this stands for a rigid contact, and why;
here are the formulas.
"""

import math
from dataclasses import dataclass, replace

RADIUS = 2e-3
"""Radius of a grain [m]."""
DENSITY = 1300.0
"""Density of a grain [kg/m3]."""
POISSON = 0.25
"""Poisson's ratio of a grain [-]."""
MASS = DENSITY * 4.0 / 3.0 * math.pi * RADIUS**3
"""Mass of a grain [kg]."""
LEAST_WITHOUT_TENSION = math.exp(-2.0)
"""Restitution of the critically damped contact that lets go when its force would pull [-]."""
LEAST_RESTITUTION = 0.01
"""LAMMPS takes the logarithm of e: this stands for 0."""
TANGENTIAL_INERTIA = 3.5
"""A_t / A_n of docs/theory/contact.md."""
ROLLING_INERTIA = {"pair": 1.25, "wall": 2.5}
"""A_r of docs/theory/contact.md, 5/2 (l_i^2 + l_j^2): m d(rho)/dt = -A_r times a rolling force."""


@dataclass(frozen=True, kw_only=True)
class Law:
    """Coefficients of a contact, with the conventions of `granulcal.Material`.

    Attributes:
        sliding_friction: mu_s [-].
        rolling_friction: mu_r between grains [-], relative to the effective radius.
        restitution: e [-].
        wall_rolling_friction: mu_r at walls [-].
    """

    sliding_friction: float
    rolling_friction: float
    restitution: float
    wall_rolling_friction: float

    def rolling_friction_at(self, at: str) -> float:
        """Returns mu_r at a `pair` or a `wall` [-]."""
        return self.rolling_friction if at == "pair" else self.wall_rolling_friction


@dataclass(frozen=True, kw_only=True)
class Elastic:
    """What LAMMPS needs and a rigid law does not know. The defaults stand for the rigid law.

    Attributes:
        young: Young's modulus [Pa].
        step: time step over the time of a Rayleigh wave across half a grain [-].
        damping: LAMMPS' normal dashpot, `coeff_restitution` or `tsuji`.
        tension: whether the dashpot may pull a parting contact together; None is only where
            there is no other way, below e = exp(-2).
        tangential: LAMMPS' tangential model.
        tangential_damping: tangential over normal dashpot [-]; None is critical damping.
        rolling_rate: angular frequency of the rolling spring times the time step [-].
        rolling_damping: rolling dashpot over its critical value [-].
        torsion: whether torsion is resisted too, by a moment of at most that of rolling.
    """

    young: float = 1e7
    step: float = 0.2
    damping: str = "coeff_restitution"
    tension: bool | None = None
    tangential: str = "mindlin_rescale/force"
    tangential_damping: float | None = None
    rolling_rate: float = 0.25
    rolling_damping: float = 0.7
    torsion: bool = True

    @property
    def dt(self) -> float:
        """Time step [s]."""
        shear = self.young / (2.0 * (1.0 + POISSON))
        rayleigh = math.pi * RADIUS * math.sqrt(DENSITY / shear) / (0.1631 * POISSON + 0.8766)
        return self.step * rayleigh

    def pulls(self, restitution: float) -> bool:
        """Returns whether contacts of this restitution pull when they part."""
        return restitution < LEAST_WITHOUT_TENSION if self.tension is None else self.tension


USUAL = Elastic(
    damping="tsuji",
    tension=True,
    tangential="mindlin",
    tangential_damping=1.0,
    rolling_rate=0.035,
    rolling_damping=0.2,
    torsion=False,
)
"""Settings as they are met in inputs: Tsuji's dashpot, a soft rolling spring that rebounds."""
RIGID = Elastic()
SETTINGS = {
    "rigid": RIGID,
    "usual": USUAL,
    "stiff_rolling": replace(RIGID, step=0.1),
    "no_torsion": replace(RIGID, torsion=False),
    "tension": replace(RIGID, tension=True),
    "tangential": replace(RIGID, tangential="mindlin", tangential_damping=1.0),
    "soft_rolling": replace(RIGID, rolling_rate=0.035, rolling_damping=0.2),
}
"""Settings by name: `rigid` stands for our law, `stiff_rolling` has half its step and so a rolling
spring four times stiffer, the last four take one thing back from it."""


def damping_ratio(restitution: float, *, tension: bool) -> float:
    """Returns the ratio beta of the normal dashpot to its critical value for a restitution e [-].

    With tension e = exp(-pi beta / sqrt(1 - beta^2)). A contact that lets go as soon as its force
    would pull has e = exp(-2 beta acos(beta) / sqrt(1 - beta^2)), at least exp(-2).
    """
    if tension:
        decrement = -math.log(max(restitution, LEAST_RESTITUTION))
        return decrement / math.hypot(math.pi, decrement)
    low, high = 0.0, 1.0 - 1e-12
    for _ in range(60):
        beta = 0.5 * (low + high)
        realised = math.exp(-2.0 * beta * math.acos(beta) / math.sqrt(1.0 - beta * beta))
        low, high = (beta, high) if realised > restitution else (low, beta)
    return 0.5 * (low + high)


def nominal_restitution(beta: float) -> float:
    """Returns the e with which LAMMPS' `coeff_restitution` takes the damping ratio beta [-]."""
    return math.exp(-math.pi * beta / math.sqrt(1.0 - beta * beta))


def critical_tangential_damping(beta: float) -> float:
    """Returns tangential over normal dashpot for a critically damped sticking contact [-]."""
    stiffness_ratio = 3.0 * (1.0 - POISSON) / (2.0 - POISSON)
    return 2.0 * math.sqrt(stiffness_ratio / (5.0 * TANGENTIAL_INERTIA)) / beta


def contact(law: Law, elastic: Elastic, at: str) -> str:
    """Returns the arguments of LAMMPS' `granular` styles for contacts at a `pair` or a `wall`."""
    pulls = elastic.pulls(law.restitution)
    beta = damping_ratio(law.restitution, tension=pulls)
    nominal = law.restitution
    if elastic.damping == "coeff_restitution":
        nominal = nominal_restitution(beta)
    ratio = elastic.tangential_damping
    if ratio is None:
        ratio = critical_tangential_damping(beta)
    rate = elastic.rolling_rate / elastic.dt
    effective_mass = MASS / ROLLING_INERTIA[at]
    k = effective_mass * rate**2
    gamma = 2.0 * elastic.rolling_damping * effective_mass * rate
    mu_r = law.rolling_friction_at(at)
    words = [
        f"hertz/material {elastic.young} {nominal} {POISSON}",
        f"tangential {elastic.tangential} NULL {ratio} {law.sliding_friction}",
        f"rolling sds {k} {gamma} {mu_r}",
        f"damping {elastic.damping}",
    ]
    if elastic.torsion:
        # Counted in an angle and a moment: two levers more, and a limit in metres.
        lever = RADIUS / 2.0 if at == "pair" else RADIUS
        words.append(f"twisting sds {k * lever**2} {gamma * lever**2} {mu_r * lever}")
    if not pulls:
        words.append("limit_damping")
    return " ".join(words)
