"""Pours the rows of rows.py in granulcal and compares the piles with those of another engine.

    python benches/peers/compare.py --presets default accurate --seeds 4
    python benches/peers/compare.py --presets default --engine liggghts --settings epsd2

The other engine itself is not needed: its piles are in lammps.csv or liggghts.csv. LIGGGHTS has no
torsion, and its dashpots pull: `LAWS` has what granulcal's material is told of each. Differences
are of the means over seeds, with their standard error.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from lammps_contact import Law
from liggghts import DASHPOT
from pile import measure
from rows import rows

import granulcal as gc
from granulcal.export.law import pulling_duration

HERE = Path(__file__).parent
LAWS: dict[tuple[str, str], dict[str, float]] = {
    ("liggghts", "epsd"): {
        "torsional_friction": 0.0,
        "rolling_dashpot": DASHPOT * pulling_duration(0.3),
        "impact_friction": 1.16,
    },
    ("liggghts", "epsd2"): {"torsional_friction": 0.0, "impact_friction": 1.16},
}
"""Numbers of granulcal's law by engine and settings, those for dashpots that pull at e 0.3; of
LAMMPS torsion is as strong as rolling."""
MEASURES = ("max_z", "mean_z", "mean_r", "r95")
COMPARED = ("mean_z", "mean_r", "r95")
BAR = 5.0
"""Difference that is asked for at most in mean z, mean r and 95 % r [%]."""
FEW = 20
"""A pour that leaves more grains than this in the funnel has jammed."""
FLAT = 6.0
"""A top below this is no pile: the grains roll until they are examined [mm]."""

Piles = list[dict[str, float]]


def scene_of(law: Law, numbers: dict[str, float] | None) -> gc.Scene:
    """Returns the funnel with the coefficients of a row and further numbers of the law."""
    torsion = {"torsional_friction": law.rolling_friction}  # as in the LAMMPS rows
    material = gc.Material(
        sliding_friction=law.sliding_friction,
        rolling_friction=law.rolling_friction,
        restitution=law.restitution,
        **(torsion if numbers is None else numbers),
    )
    kinds = ("rolling", "torsional") if numbers is None else ("rolling",)
    at_walls = {
        f"{wall}.material.{kind}_friction": law.wall_rolling_friction
        for wall in ("ground", "funnel")
        for kind in kinds
    }
    return gc.Scene.funnel(height=0.12).with_material(material).with_(at_walls)


def of_granulcal(scene: gc.Scene, preset: str, seeds: int) -> Piles:
    """Returns our piles of a row, one for each seed."""
    pours = (gc.simulate(scene, seed=seed + 1, preset=preset) for seed in range(seeds))
    return [
        {
            **measure(pour.positions),
            "cpu_s": pour.cpu_seconds,
            "worst_overlap": 0.5 * pour.health["worst_penetration"],
            "unhealthy": pour.status == "unhealthy",
        }
        for pour in pours
    ]


def of_other(engine: str, row: str, settings: str, young: str) -> Piles:
    """Returns the other engine's piles of a row."""
    with (HERE / f"{engine}.csv").open() as file:
        return [
            {
                name: float(value)
                for name, value in pile.items()
                if name not in ("row", "settings", "young", "seed")
            }
            for pile in csv.DictReader(file)
            if (pile["row"], pile["settings"], pile["young"]) == (row, settings, young)
        ]


def column(piles: Piles, name: str) -> np.ndarray:
    """Returns a measure of the pours that did not jam."""
    return np.array([pile[name] for pile in piles if pile["held"] <= FEW])


def mean_and_sd(piles: Piles, name: str) -> str:
    """Returns a measure as text."""
    values = column(piles, name)
    if len(values) == 0:
        return "-"
    digits = 2 if name == "mean_z" else 1
    spread = f" ± {values.std(ddof=1):.{digits}f}" if len(values) > 1 else ""
    return f"{values.mean():.{digits}f}{spread}"


def difference(ours: Piles, theirs: Piles, name: str) -> tuple[float, float]:
    """Returns by how much ours is above theirs [%] and its standard error, NaN for one pour [%]."""
    a, b = column(ours, name), column(theirs, name)
    variance = sum(
        values.var(ddof=1) / len(values) if len(values) > 1 else np.nan for values in (a, b)
    )
    return 100.0 * (a.mean() / b.mean() - 1.0), 100.0 * float(np.sqrt(variance)) / b.mean()


def line(engine: str, piles: Piles, row: str, law: Law, against: Piles | None) -> str:
    """Returns one row of the table."""
    rolling = f"{law.rolling_friction:g}"
    if law.wall_rolling_friction != law.rolling_friction:
        rolling += f" / {law.wall_rolling_friction:g}"
    jammed = sum(pile["held"] > FEW for pile in piles)
    cells = [row, f"{law.sliding_friction:g}", rolling, f"{law.restitution:g}", engine]
    cells += [str(len(piles)), str(jammed)]
    for name in MEASURES:
        cell = mean_and_sd(piles, name)
        if against and name in COMPARED and comparable(piles) and comparable(against):
            percent, error = difference(piles, against, name)
            plus_minus = "" if np.isnan(error) else f" ± {error:.1f}"
            cell += f" ({percent:+.1f}{plus_minus} %)"
        cells.append(cell)
    cells.append(f"{100.0 * max(pile['worst_overlap'] for pile in piles):.1f}")
    cells.append(f"{np.mean([pile['cpu_s'] for pile in piles]):.2f}")
    return "| " + " | ".join(cells) + " |"


def comparable(piles: Piles) -> bool:
    """Returns whether there is a pile to measure: not all jammed, and grains lie on others."""
    tops = column(piles, "max_z")
    return len(tops) > 0 and tops.mean() > FLAT


def main() -> None:
    """Prints one line for each row and engine, and how many differences are within the bar."""
    laws = rows()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="+", choices=laws, default=list(laws))
    parser.add_argument("--presets", nargs="+", default=["default", "accurate"])
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--engine", choices=("lammps", "liggghts"), default="lammps")
    parser.add_argument("--settings", default="rigid", help="the other engine's, as in its file")
    parser.add_argument("--young", default="1e+07", help="Young's modulus in its file [Pa]")
    options = parser.parse_args()
    head = (
        "row|mu_s|mu_r (/ walls)|e|engine|pours|jammed|max z|mean z|mean r|95 % r|overlap %|CPU s"
    )
    print(f"| {' | '.join(head.split('|'))} |")
    print("|---" * 13 + "|")
    met: dict[str, list[bool]] = {preset: [] for preset in options.presets}
    for row in options.rows:
        law, of = laws[row], (options.engine, options.settings)
        theirs = of_other(options.engine, row, options.settings, options.young)
        scene = scene_of(law, LAWS.get(of))
        if theirs:
            print(line(options.engine.upper(), theirs, row, law, None), flush=True)
        for preset in options.presets:
            ours = of_granulcal(scene, preset, options.seeds)
            print(line(f"`{preset}`", ours, row, law, theirs), flush=True)
            if any(pile["unhealthy"] for pile in ours):
                print(f"row {row}: {preset} was unhealthy")
            if theirs and comparable(ours) and comparable(theirs):
                percent = [abs(difference(ours, theirs, name)[0]) for name in COMPARED]
                met[preset] += [value <= BAR for value in percent]
    print()
    for preset, within in met.items():
        print(f"{preset}: {sum(within)} of {len(within)} differences within {BAR:g} %")


if __name__ == "__main__":
    main()
