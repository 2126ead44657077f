"""Prints one table of one pour in granulcal, Rapier and, where it is installed, LAMMPS.

    python benches/peers/table.py --row P --seed 1

LAMMPS is poured twice, at E = 1e8 Pa, where grains overlap by about 1 % of their diameter, and at
1e7. `--young 1e7` leaves out the expensive one.
"""

import argparse
import subprocess
from dataclasses import replace
from pathlib import Path

from lammps_contact import Elastic, Law
from rows import rows

MANIFEST = Path(__file__).parent / "Cargo.toml"
INSTALL = "python -m pip install -r benches/peers/requirements.txt"


def rust_rows(law: Law, seed: int, rapier: list[float]) -> None:
    """Builds and runs the Rust side, which prints the head of the table and its rows."""
    flags = {
        "--sliding-friction": law.sliding_friction,
        "--rolling-friction": law.rolling_friction,
        "--wall-rolling-friction": law.wall_rolling_friction,
        "--restitution": law.restitution,
        "--seed": seed,
    }
    command = ["cargo", "run", "--quiet", "--release", "--manifest-path", str(MANIFEST), "--"]
    command += [str(word) for flag in flags.items() for word in flag]
    subprocess.run([*command, "--rapier", *map(str, rapier)], check=True)


def lammps_row(law: Law, elastic: Elastic, seed: int) -> str:
    """Returns LAMMPS' row."""
    from lammps_pour import pour  # Needs LAMMPS.

    pile = pour(law, elastic, seed)
    cells = [
        f"LAMMPS, E {elastic.young:.0e}",
        f"1/{1.0 / elastic.dt:.0f}",
        f"{pile['rest_s']:.2f}",
        f"{pile['cpu_s']:.2f}",
        f"{100.0 * pile['worst_overlap']:.1f}",
        f"{pile['max_z']:.1f}",
        f"{pile['mean_z']:.2f}",
        f"{pile['mean_r']:.1f}",
        f"{pile['r95']:.1f}",
    ]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """Prints the table."""
    laws = rows()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--row", choices=laws, default="P")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--young", nargs="*", type=float, default=[1e7, 1e8], help="LAMMPS' moduli [Pa]"
    )
    parser.add_argument(
        "--rapier", nargs="*", type=float, default=[600, 4800], help="Rapier's steps a second"
    )
    options = parser.parse_args()
    law = laws[options.row]
    rust_rows(law, options.seed, options.rapier)
    for young in options.young:
        try:
            row = lammps_row(law, replace(Elastic(), young=young), options.seed)
        except ImportError as error:
            print(f"\nLAMMPS is left out ({error}): {INSTALL}")
            break
        print(row, flush=True)


if __name__ == "__main__":
    main()
