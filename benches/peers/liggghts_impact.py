"""Single grains that roll in LIGGGHTS, by `epsd` and `epsd2`.

    python benches/peers/liggghts_impact.py

Two tables: the share of the rolling velocity that a frictionless impact at 1 m/s and e 0.3 keeps,
on a wall and between grains (`tests/physics/rolling_dashpot.rs` holds our law to the rows of
`epsd`); and how a grain that rolls on the level is slowed.
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np
from lammps_contact import DENSITY, POISSON, RADIUS, Elastic
from lammps_impact import ROLLING, SPEED, table
from liggghts import DASHPOT, OPENING
from liggghts import ROLLING as MODELS

FRICTIONS = (0.05, 0.1, 0.3, 0.6)
"""mu_r [-]."""
RATIOS = (*ROLLING, 5.0)
"""Rolling over normal velocity before the impact [-]."""
RESTITUTION, GRAVITY = 0.3, 9.81
NO_FRICTION = 1e-9
"""LIGGGHTS refuses 0."""
ELASTIC = Elastic(step=0.05)
STEPS, LOOK = 4000, 4
"""Time steps of an impact, and between two looks."""
LONGER = 10
"""Time steps of a grain on the level, and between its looks, over those of an impact."""
LEVEL = ((0.03, 0.2), (0.03, 0.5), (0.1, 0.2), (0.1, 0.5))
"""mu_r [-] and speed [m/s] of grains on the level; mu_s is 0.5."""


def of_impact(at: str, ratio: float) -> str:
    """Returns the grains of an impact at a `wall` or of a `pair`, barely apart before."""
    spin, z = ratio * SPEED / RADIUS, 1.00001 * RADIUS
    if at == "wall":
        return f"""
create_atoms 1 single 0 0 {z} units box
velocity all set {ratio * SPEED} 0 {-SPEED} units box
set group all omegay {spin}
"""
    return f"""
create_atoms 1 single 0 0 {z} units box
create_atoms 1 single 0 0 {-z} units box
group upper id 1
group lower id 2
velocity upper set 0 0 {-0.5 * SPEED} units box
velocity lower set 0 0 {0.5 * SPEED} units box
set group upper omegay {spin}
set group lower omegay {-spin}
"""


def on_the_level(speed: float) -> str:
    """Returns a grain that rolls on the ground under gravity."""
    return f"""
create_atoms 1 single 0 0 {RADIUS} units box
velocity all set {speed} 0 0 units box
set group all omegay {speed / RADIUS}
fix gravity all gravity {GRAVITY} vector 0.0 0.0 -1.0
"""


def script(
    rolling_model: str, friction: float, grains: str, has_ground: bool, longer: int = 1
) -> str:
    """Returns LIGGGHTS' words for a run with these grains.

    Args:
        rolling_model: `epsd` or `epsd2`.
        friction: mu_r [-].
        grains: what makes them.
        has_ground: whether there is a ground at z = 0.
        longer: steps over those of an impact.
    """
    words = f"model hertz tangential history rolling_friction {rolling_model}"
    pairs = "peratomtypepair 1"
    sliding = NO_FRICTION if longer == 1 else 0.5
    ground = f"fix ground all wall/gran {words} primitive type 1 zplane 0.0" if has_ground else ""
    return f"""{OPENING}
region box block -0.5 0.5 -0.02 0.02 -0.02 0.04 units box
create_box 1 box
neighbor 0.001 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype {ELASTIC.young}
fix m2 all property/global poissonsRatio peratomtype {POISSON}
fix m3 all property/global coefficientRestitution {pairs} {RESTITUTION}
fix m4 all property/global coefficientFriction {pairs} {sliding}
fix m5 all property/global coefficientRollingFriction {pairs} {friction}
fix m6 all property/global coefficientRollingViscousDamping {pairs} {DASHPOT}
pair_style gran {words}
pair_coeff * *
timestep {ELASTIC.dt}
{ground}
{grains}
set group all density {DENSITY} diameter {2 * RADIUS}
fix motion all nve/sphere
dump looks all custom {longer * LOOK} looks.txt id z vz omegay
dump_modify looks sort id
run {longer * STEPS}
"""


def looks(words: str, count: int) -> np.ndarray:
    """Returns height, its rate and spin about y at every look, (looks, grains, 3) [m, m/s, 1/s]."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "in.grains").write_text(words)
        subprocess.run(
            ["liggghts", "-in", "in.grains"], cwd=place, stdout=subprocess.DEVNULL, check=True
        )
        lines = (place / "looks.txt").read_text().splitlines()
    grains = [line.split() for line in lines if len(line.split()) == 4 and line[0] in "12"]
    return np.array(grains, dtype=float).reshape(-1, count, 4)[:, :, 1:]


def kept(at: str, rolling_model: str, friction: float, ratio: float) -> float:
    """Returns the share of the rolling velocity after an impact [-]."""
    words = script(rolling_model, friction, of_impact(at, ratio), at == "wall")
    height, rate, spin = looks(words, 1 if at == "wall" else 2)[:, 0].T
    parted = np.flatnonzero((height > RADIUS) & (rate > 0.0))
    return float(spin[parted[0]] * RADIUS / (ratio * SPEED))


def slowed(rolling_model: str, friction: float, speed: float) -> float:
    """Returns how a grain is slowed in the second half of a run, over 5/7 mu_r g [-]."""
    words = script(rolling_model, friction, on_the_level(speed), True, LONGER)
    spin = looks(words, 1)[:, 0, 2]
    later = spin[len(spin) // 2 :]
    time = (len(later) - 1) * LONGER * LOOK * ELASTIC.dt
    return float((later[0] - later[-1]) * RADIUS / time / (5.0 / 7.0 * friction * GRAVITY))


def main() -> None:
    """Prints the tables."""
    lines = [
        [
            model,
            at,
            f"{friction:g}",
            *(f"{kept(at, model, friction, ratio):.2f}" for ratio in RATIOS),
        ]
        for model in MODELS
        for at in ("wall", "pair")
        for friction in FRICTIONS
    ]
    head = ["rolling", "at", "mu_r", *(f"{ratio:g}" for ratio in RATIOS)]
    table("Share of the rolling velocity kept, by rolling over normal velocity", head, lines)
    lines = [
        [model, f"{friction:g}", f"{speed:g}", f"{slowed(model, friction, speed):.3f}"]
        for model in MODELS
        for friction, speed in LEVEL
    ]
    head = ["rolling", "mu_r", "m/s", "over 5/7 mu_r g"]
    table("Slowed on the level", head, lines)


if __name__ == "__main__":
    main()
