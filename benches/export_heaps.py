"""The exported pour in other engines beside ours, the table of docs/export.md.

    python benches/export_heaps.py
    python benches/export_heaps.py --engines lammps yade --rows heap --seeds 2
    python benches/export_heaps.py --engines --seeds 4        # ours alone

Pours what export_heaps.csv lacks and prints the table. Engines that are not installed are left
out; those of PyPI are looked for in build/engines-venv too. A pour is kept once it is made; ours
are made anew when our simulator has changed, those of the engines stay.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

import granulcal as gc
from granulcal.engines import ExportedEngine, installed

ROOT = Path(__file__).parents[1]
RESULTS = Path(__file__).with_suffix(".csv")
VENV = ROOT / "build/engines-venv"
ENGINES = ("lammps", "liggghts", "yade", "mujoco", "newton")
COUNT, TIP = 400, 0.06
ROWS = {
    "heap": gc.Material(sliding_friction=0.5, rolling_friction=0.4, restitution=0.3),
    "spread": gc.Material(sliding_friction=0.4, rolling_friction=0.1, restitution=0.5),
}
NAMES = ("row", "engine", "simulator", "seed", "mean_z", "max_z", "mean_r", "r95")
MEASURES = NAMES[4:]


def scene(row: str) -> gc.Scene:
    """Returns 400 grains through the paper's funnel, its tip 6 cm above the ground."""
    return gc.Scene.funnel(TIP, count=COUNT, material=ROWS[row])


def measures(centres: np.ndarray) -> list[float]:
    """Returns mean and largest height, mean and 95 % distance from the median axis [mm]."""
    flat = centres[:, :2] - np.median(centres[:, :2], axis=0)
    r, z = np.hypot(*flat.T), centres[:, 2]
    return [1e3 * float(v) for v in (z.mean(), z.max(), r.mean(), np.quantile(r, 0.95))]


def simulator() -> str:
    """Returns what our pours depend on: the final state of a small one."""
    return gc.simulate(gc.Scene.drop(0.03, count=40, preset="fast"), seed=1).state_hash[:12]


def engine(name: str) -> ExportedEngine | None:
    """Returns an engine, None if it is not installed."""
    if installed(name):
        return ExportedEngine(name)
    python = VENV / "bin" / "python"
    lmp = VENV / "bin" / "lmp"
    if name in ("mujoco", "newton") and python.exists():
        return ExportedEngine(name, python=str(python))
    if name == "lammps" and lmp.exists():
        return ExportedEngine(name, python=str(lmp))
    return None


def read() -> list[dict[str, str]]:
    """Returns the pours that are kept."""
    if not RESULTS.exists():
        return []
    with RESULTS.open() as file:
        return list(csv.DictReader(file))


def pour(row: str, name: str, seed: int) -> list[float]:
    """Returns the measures of a pour."""
    if name == "granulcal":
        return measures(gc.simulate(scene(row), seed=seed).positions)
    made = engine(name)
    assert made is not None
    left = made(scene(row), seed)
    assert isinstance(left, tuple)
    return measures(left[0])


def table(rows: list[dict[str, str]], ours: str) -> str:
    """Returns the table: means over seeds, and differences from ours [%]."""
    lines = ["| material | engine | pours | mean z [mm] | top [mm] | mean r [mm] | 95 % r [mm] |"]
    lines.append("|---" * 7 + "|")
    for row in ROWS:
        kept = [r for r in rows if r["row"] == row]
        base = [r for r in kept if r["engine"] == "granulcal" and r["simulator"] == ours]
        for name in ("granulcal", *ENGINES):
            own = base if name == "granulcal" else [r for r in kept if r["engine"] == name]
            if not own:
                continue
            cells = [row, name, str(len(own))]
            for key in MEASURES:
                value = np.mean([float(r[key]) for r in own])
                cell = f"{value:.1f}"
                if base and name != "granulcal":
                    mean = np.mean([float(r[key]) for r in base])
                    cell += f" ({100 * (value / mean - 1):+.0f} %)"
                cells.append(cell)
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Pours what is missing and prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="+", choices=ROWS, default=list(ROWS))
    parser.add_argument("--engines", nargs="*", choices=ENGINES, default=list(ENGINES))
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    rows, ours = read(), simulator()
    there = {(r["row"], r["engine"], r["simulator"], r["seed"]) for r in rows}
    wanted = ["granulcal", *(name for name in options.engines if engine(name) is not None)]
    for row in options.rows:
        for name in wanted:
            for seed in map(str, range(1, options.seeds + 1)):
                key = (row, name, ours if name == "granulcal" else "-", seed)
                if key in there:
                    continue
                found = [f"{value:.4g}" for value in pour(row, name, int(seed))]
                print(*key, *found, flush=True)
                rows.append(dict(zip(NAMES, (*key, *found), strict=True)))
                with RESULTS.open("w", newline="") as file:
                    writer = csv.DictWriter(file, NAMES, lineterminator="\n")
                    writer.writeheader()
                    writer.writerows(rows)
    print(table(rows, ours))


if __name__ == "__main__":
    main()
