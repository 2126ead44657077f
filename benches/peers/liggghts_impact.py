"""Share of the rolling velocity that a frictionless impact keeps in LIGGGHTS.

    python benches/peers/liggghts_impact.py

Impacts at 1 m/s and e 0.3 on a wall and between two grains, by `epsd` and `epsd2`.
`tests/physics/rolling_dashpot.rs` holds our law to the rows of `epsd`.
"""

import subprocess
import tempfile
from pathlib import Path

import numpy as np
from lammps_contact import DENSITY, POISSON, RADIUS, Elastic
from lammps_impact import ROLLING, SPEED, table

FRICTIONS = (0.05, 0.1, 0.3, 0.6)
"""mu_r [-]."""
RATIOS = (*ROLLING, 5.0)
"""Rolling over normal velocity before the impact [-]."""
RESTITUTION, DASHPOT = 0.3, 0.7
NO_FRICTION = 1e-9
"""LIGGGHTS refuses 0."""
ELASTIC = Elastic(step=0.05)
STEPS, LOOK = 4000, 4
"""Time steps of a run, and between two looks."""


def script(at: str, rolling_model: str, friction: float, ratio: float) -> str:
    """Returns LIGGGHTS' words for an impact at a `wall` or of a `pair`, barely apart before."""
    words, pairs = (
        f"model hertz tangential history rolling_friction {rolling_model}",
        ("peratomtypepair 1"),
    )
    spin, z = ratio * SPEED / RADIUS, 1.00001 * RADIUS
    if at == "wall":
        grains = f"""
create_atoms 1 single 0 0 {z} units box
fix ground all wall/gran {words} primitive type 1 zplane 0.0
velocity all set {ratio * SPEED} 0 {-SPEED} units box
set group all omegay {spin}
"""
    else:
        grains = f"""
create_atoms 1 single 0 0 {z} units box
create_atoms 1 single 0 0 {-z} units box
group upper id 1
group lower id 2
velocity upper set 0 0 {-0.5 * SPEED} units box
velocity lower set 0 0 {0.5 * SPEED} units box
set group upper omegay {spin}
set group lower omegay {-spin}
"""
    return f"""
atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
region box block -0.5 0.5 -0.02 0.02 -0.02 0.04 units box
create_box 1 box
neighbor 0.001 bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype {ELASTIC.young}
fix m2 all property/global poissonsRatio peratomtype {POISSON}
fix m3 all property/global coefficientRestitution {pairs} {RESTITUTION}
fix m4 all property/global coefficientFriction {pairs} {NO_FRICTION}
fix m5 all property/global coefficientRollingFriction {pairs} {friction}
fix m6 all property/global coefficientRollingViscousDamping {pairs} {DASHPOT}
pair_style gran {words}
pair_coeff * *
timestep {ELASTIC.dt}
{grains}
set group all density {DENSITY} diameter {2 * RADIUS}
fix motion all nve/sphere
dump looks all custom {LOOK} looks.txt id z vz omegay
dump_modify looks sort id
run {STEPS}
"""


def kept(at: str, rolling_model: str, friction: float, ratio: float) -> float:
    """Returns the share of the rolling velocity after an impact [-]."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        (place / "in.impact").write_text(script(at, rolling_model, friction, ratio))
        subprocess.run(
            ["liggghts", "-in", "in.impact"], cwd=place, stdout=subprocess.DEVNULL, check=True
        )
        lines = (place / "looks.txt").read_text().splitlines()
    count = 1 if at == "wall" else 2
    grains = [line.split() for line in lines if len(line.split()) == 4 and line[0] in "12"]
    looks = np.array(grains, dtype=float).reshape(-1, count, 4)
    height, spin = looks[:, 0, 1], looks[:, 0, 3]
    parted = np.flatnonzero((height > RADIUS) & (looks[:, 0, 2] > 0.0))
    return float(spin[parted[0]] * RADIUS / (ratio * SPEED))


def main() -> None:
    """Prints the table."""
    lines = [
        [
            model,
            at,
            f"{friction:g}",
            *(f"{kept(at, model, friction, ratio):.2f}" for ratio in RATIOS),
        ]
        for model in ("epsd", "epsd2")
        for at in ("wall", "pair")
        for friction in FRICTIONS
    ]
    head = ["rolling", "at", "mu_r", *(f"{ratio:g}" for ratio in RATIOS)]
    table("Share of the rolling velocity kept, by rolling over normal velocity", head, lines)


if __name__ == "__main__":
    main()
