"""Compares granulcal's contact solver with siconos' on frozen substeps.

    python3 scripts/referee/referee.py --cli target/release/granulcal-cli

Python is the one that siconos is installed for (scripts/referee/install.sh). Exit code 1 when a
case ends otherwise than cases.py expects.
"""

import argparse
import json
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from cases import CASES, Case
from frozen import FrozenProblem
from siconos_solver import SOLVED, go_on_from, solve, solve_in_planes_of

AGREE = 1e-10  # largest difference of a velocity or spin of any grain [m/s]


def main() -> int:
    """Run the cases and print one row each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cli", default="granulcal-cli", help="the command line, words and all")
    parser.add_argument("--case", action="append", help="only these; repeat as needed")
    parser.add_argument("--out", type=Path, help="keep the exported problems in this folder")
    parser.add_argument("--json", action="store_true", help="one JSON object a case, no table")
    given = parser.parse_args()
    known = {case.name: case for case in CASES}
    if unknown := [name for name in given.case or [] if name not in known]:
        parser.error(f"--case must be one of {', '.join(known)}, got {', '.join(unknown)}")
    cases = [known[name] for name in given.case] if given.case else CASES
    if not given.json:
        print(_line([name for name, _ in COLUMNS]), _line(["---"] * len(COLUMNS)), sep="\n")
    verdicts = []
    with tempfile.TemporaryDirectory() as scratch:
        for case in cases:
            row = examine(case, shlex.split(given.cli), given.out or Path(scratch))
            verdicts.append(row["verdict"])
            shown = json.dumps(row) if given.json else _line([show(row) for _, show in COLUMNS])
            print(shown, flush=True)
    if not given.json:
        counts = [f"{verdicts.count(word)} {word}" for word in sorted(set(verdicts))]
        print(f"\n{len(cases)} substeps at a tolerance of {AGREE:g} m/s: {', '.join(counts)}")
    return int(verdicts != [case.expected for case in cases])


def examine(case: Case, cli: list[str], folder: Path) -> dict:
    """Export a case, solve it with siconos and compare the velocities of the grains."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{case.name}.npz"
    subprocess.run([*cli, *case.arguments(path)], check=True, stdout=subprocess.DEVNULL)
    problem = FrozenProblem(path)
    ours = problem["impulse"]
    solution = solve(problem)
    if solution.residual > SOLVED and np.any(problem["rolling_friction"]):
        solution = solve_in_planes_of(problem, ours)

    def apart(impulses: np.ndarray) -> np.ndarray:
        """Return by how much each grain's velocity or spin differs [m/s]."""
        return np.abs(problem.velocities(impulses) - problem["velocity"]).max(axis=1)

    row = {
        "case": case.name,
        "sliding_friction": case.sliding_friction,
        "rolling_friction": case.rolling_friction,
        "restitution": case.restitution,
        "contacts": problem.count,
        "carrying": int(np.count_nonzero(ours[:, 0] > 0.0)),
        "sweeps": int(problem["sweeps"]),
        "residual": problem.residual(ours),
        "law": solution.law,
        "siconos_turns": solution.turns,
        "siconos_sweeps": solution.sweeps,
        "siconos_residual": solution.residual,
        "change": float(np.abs(problem["velocity"] - problem["free_velocity"]).max()),
        "difference": float(apart(solution.impulses).max()),
        "grains_apart": int(np.count_nonzero(apart(solution.impulses) > AGREE)),
        "difference_from_ours": float(apart(go_on_from(problem, ours)).max()),
    }
    row["verdict"] = _verdict(row)
    return row


def _verdict(row: dict) -> str:
    """Say in a word or two how the case ended."""
    if row["residual"] > SOLVED:
        return "granulcal unsolved"
    if row["siconos_residual"] > SOLVED:
        return "siconos unsolved"
    if row["difference"] <= AGREE:
        return "agrees"
    # Both satisfy the law to rounding; siconos, which stays where granulcal ended, says so, too.
    return "two solutions" if row["difference_from_ours"] <= AGREE else "differs"


COLUMNS = (
    ("case", lambda row: row["case"]),
    ("μ_s", lambda row: f"{row['sliding_friction']:g}"),
    ("μ_r", lambda row: f"{row['rolling_friction']:g}"),
    ("e", lambda row: f"{row['restitution']:g}"),
    ("contacts, carrying", lambda row: f"{row['contacts']}, {row['carrying']}"),
    ("sweeps", lambda row: str(row["sweeps"])),
    ("residual", lambda row: f"{row['residual']:.0e}"),
    ("siconos", lambda row: row["law"]),
    ("turns, sweeps", lambda row: f"{row['siconos_turns']}, {row['siconos_sweeps']}"),
    ("residual", lambda row: f"{row['siconos_residual']:.0e}"),
    ("contacts change v by", lambda row: f"{row['change']:.2g}"),
    ("difference", lambda row: f"{row['difference']:.1e}"),
    ("from ours", lambda row: f"{row['difference_from_ours']:.1e}"),
    ("verdict", lambda row: row["verdict"]),
)


def _line(words: list[str]) -> str:
    return "| " + " | ".join(words) + " |"


if __name__ == "__main__":
    sys.exit(main())
