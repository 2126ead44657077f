"""What another engine alone changes: matched pours of it and of granulcal, without any effect.

    python benches/blind/code_pairs.py --materials 20 --out out/pairs
    python benches/blind/code_pairs.py --engine epsd2 --young 1e7 --out out/liggghts

Materials are drawn from prior.toml; each is poured once in LAMMPS, or in LIGGGHTS with the rolling
friction that `--engine` names, and six times in granulcal at every height, and seen by the same
camera without noise. Pours that are there are not made again.
Writes code_difference.json and code_difference.csv beside this file, or into the folder of --table.
"""

import argparse
import csv
import json
from pathlib import Path

import engine
import numpy as np
from answers import write_text
from arguments import add_law, add_young
from engines import ENGINES, Engine, add_engine
from make import CONDITIONS, TRIES
from scene import PARAMETERS, PRIOR, Bench

import granulcal as gc
from granulcal.files import beside
from granulcal.pours.statistics import DIAGNOSTIC_NAMES, NAMES

HERE = Path(__file__).parent
SEED = 20_000
"""Of the materials: public, the blind sets have another."""
OURS = 6
"""Pours of granulcal of a material at a height."""
ALL = (*NAMES, *DIAGNOSTIC_NAMES)
HEIGHTS = sorted(height for group in CONDITIONS.values() for height in group)
"""Of the funnel's tip [m]."""


def pair(
    bench: Bench, pour: Engine, theta: np.ndarray, height: float, seed: int
) -> dict[str, np.ndarray]:
    """Returns the statistics of the other engine's pour (56,) and of granulcal pours (k, 56)."""
    for attempt in range(TRIES):
        pile = pour(bench.setup(theta, height, seed + attempt))
        if pile.held == 0:
            break
    ours = (bench.pour(theta, height, seed + number) for number in range(OURS))
    piles = [(p.positions, p.radii) for p in ours if p.status in ("at_rest", "out_of_view")]
    seen = [bench.observe(*grains) for grains in [(pile.centres, pile.radii), *piles]]
    rows = np.array([np.concatenate([o.paper16, o.diagnostics]) for o in seen])
    return {"theirs": rows[0], "ours": rows[1:], "held": np.array(pile.held)}


def collect(
    bench: Bench, pour: Engine, materials: int, heights: list[float], folder: Path
) -> tuple[np.ndarray, dict[float, list[dict]]]:
    """Returns the materials (m, 3) and the pairs of every height, made where they are missing."""
    folder.mkdir(parents=True, exist_ok=True)
    theta = gc.Prior.load(PRIOR).sample(materials, seed=SEED)
    pairs: dict[float, list[dict]] = {height: [] for height in heights}
    for number, row in enumerate(theta):
        for height in heights:
            file = folder / f"{number:02d}-{round(1000 * height):03d}.npz"
            if not file.exists():
                found = pair(bench, pour, row, height, SEED + 100 * number)
                with beside(file) as draft:
                    np.savez(draft, **found)
            pairs[height].append(dict(np.load(file)))
        print(f"material {number + 1} of {materials}", flush=True)
    return theta, pairs


def summary(pairs: list[dict]) -> dict:
    """Returns the differences of a height, theirs less granulcal's, in sds of granulcal's seeds.

    `sd`: of a statistic from seed to seed, pooled over the materials (56,). `mean`: of the
    difference over the materials (56,), `error` its standard error. `covariance`: of the difference
    of the 16 from material to material (16, 16), less what the seeds of the pours put into it, so
    it may be indefinite. `differences`: of every material, NaN where a pour was left out.
    """
    usable = [p for p in pairs if p["held"] == 0 and len(p["ours"]) > 2]
    within = np.concatenate([p["ours"] - p["ours"].mean(axis=0) for p in usable])
    freedom = len(within) - len(usable)
    sd = np.sqrt((within**2).sum(axis=0) / freedom)
    scale = np.where(sd > 0.0, sd, 1.0)
    seeds = (within / scale).T @ (within / scale) / freedom
    rows = [
        (p["theirs"] - p["ours"].mean(axis=0)) / scale
        if p["held"] == 0 and len(p["ours"]) > 2
        else np.full(len(ALL), np.nan)
        for p in pairs
    ]
    good = np.array([row for row in rows if np.isfinite(row).all()])
    noise = np.mean([1.0 + 1.0 / len(p["ours"]) for p in usable]) * seeds
    head = slice(0, len(NAMES))
    return {
        "sd": sd,
        "mean": good.mean(axis=0),
        "error": good.std(axis=0, ddof=1) / np.sqrt(len(good)),
        "covariance": np.cov(good[:, head], rowvar=False) - noise[head, head],
        "materials": len(good),
        "differences": np.array(rows),
        "noise": noise[head, head],
        "ours": np.array([p["ours"].mean(axis=0) / scale for p in pairs]),
    }


def left_by_material(theta: np.ndarray, found: dict[float, dict]) -> dict[str, float | np.ndarray]:
    """Returns how much of the difference no other material of granulcal would mimic.

    Least squares over the 16 statistics at all heights, the derivatives by mu_s, ln mu_r and e from
    a linear regression over the materials. `mean`: rms of the mean difference, `mean_left` of what
    is left of it, `shift` of the material that takes the rest (3,). `each_left`: rms of what is
    left of each material's own difference, `seeds_left` what the seeds of the pours leave of it.
    All but the shift in sds.
    """
    coordinates = np.column_stack([theta[:, 0], np.log(theta[:, 1]), theta[:, 2]])
    head = slice(0, len(NAMES))
    differences = np.concatenate([s["differences"][:, head] for s in found.values()], axis=1)
    ours = np.concatenate([s["ours"][:, head] for s in found.values()], axis=1)
    good = np.isfinite(differences).all(axis=1)
    design = np.column_stack([np.ones(good.sum()), coordinates[good] - coordinates[good].mean(0)])
    slope = np.linalg.lstsq(design, ours[good], rcond=None)[0][1:].T
    keep = np.eye(len(slope)) - slope @ np.linalg.pinv(slope)
    noise = np.zeros_like(keep)
    for i, s in enumerate(found.values()):
        block = slice(i * len(NAMES), (i + 1) * len(NAMES))
        noise[block, block] = s["noise"]
    mean = differences[good].mean(axis=0)
    return {
        "mean": float(np.sqrt((mean**2).mean())),
        "mean_left": float(np.sqrt(((keep @ mean) ** 2).mean())),
        "shift": np.linalg.pinv(slope) @ mean,
        "each_left": float(np.sqrt(((differences[good] @ keep) ** 2).mean())),
        "seeds_left": float(np.sqrt(np.trace(keep @ noise @ keep) / len(keep))),
    }


def write(theta: np.ndarray, found: dict[float, dict], theirs: str, folder: Path) -> None:
    """Writes the numbers that a reader takes for a nuisance, and all differences as a table."""
    head = {
        "names": list(NAMES),
        "diagnostic_names": list(DIAGNOSTIC_NAMES),
        "unit": "standard deviations of a pour of granulcal from seed to seed, sd",
        "difference": f"{theirs} less granulcal",
        "prior": PRIOR.name,
    }
    heights = {}
    for height, s in found.items():
        heights[f"{height:g}"] = {
            "materials": s["materials"],
            "sd": _short(s["sd"][:16]),
            "mean": _short(s["mean"][:16]),
            "error": _short(s["error"][:16]),
            "covariance": [_short(row) for row in s["covariance"]],
            "diagnostic_sd": _short(s["sd"][16:]),
            "diagnostic_mean": _short(s["mean"][16:]),
            "diagnostic_error": _short(s["error"][16:]),
        }
    folder.mkdir(parents=True, exist_ok=True)
    write_text(folder / "code_difference.json", json.dumps({**head, "heights": heights}) + "\n")
    with (folder / "code_difference.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["material", *PARAMETERS, "height", *ALL])
        for number, row in enumerate(theta):
            for height, s in found.items():
                values = [f"{v:.3g}" for v in s["differences"][number]]
                writer.writerow([number, *(f"{v:.4g}" for v in row), f"{height:g}", *values])


def _short(values: np.ndarray) -> list[float]:
    return [float(f"{v:.4g}") for v in values]


def main() -> None:
    """Makes the pairs and prints the mean differences of the 16 statistics."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--materials", type=int, default=20)
    parser.add_argument("--out", type=Path, default=Path("out/pairs"))
    add_young(parser, engine.YOUNG)
    add_law(parser)
    add_engine(parser)
    parser.add_argument("--heights", type=float, nargs="+", default=HEIGHTS, help="of the tip [m]")
    parser.add_argument("--table", type=Path, help="folder of the two files; here for LAMMPS")
    options = parser.parse_args()
    engine.YOUNG = options.young
    bench, pour = Bench.load(dict(options.law)), ENGINES[options.engine]
    theta, pairs = collect(bench, pour, options.materials, options.heights, options.out)
    found = {height: summary(rows) for height, rows in pairs.items()}
    table = options.table or (HERE if options.engine == "lammps" else options.out)
    write(theta, found, options.engine, table)
    print("| statistic | " + " | ".join(f"{100 * h:g} cm" for h in found) + " |")
    print("|---" * (len(found) + 1) + "|")
    for i, name in enumerate(NAMES):
        cells = [f"{s['mean'][i]:+.2f} ± {s['error'][i]:.2f}" for s in found.values()]
        print(f"| {name} | " + " | ".join(cells) + " |")
    for label, of in (
        ("rms of the mean difference", lambda s: np.sqrt((s["mean"][:16] ** 2).mean())),
        ("rms sd between materials", lambda s: np.sqrt(max(np.trace(s["covariance"]), 0) / 16)),
        ("materials", lambda s: s["materials"]),
    ):
        print(f"| {label} | " + " | ".join(f"{of(s):.2f}" for s in found.values()) + " |")
    left = left_by_material(theta, found)
    moved = ", ".join(f"{v:+.2f}" for v in left["shift"])
    print(f"\nrms of the mean {left['mean']:.2f}, {left['mean_left']:.2f} of it is left by another")
    print(f"material (mu_s, ln mu_r, e: {moved}); of each material's own difference")
    print(
        f"{left['each_left']:.2f} is left, {left['seeds_left']:.2f} by the seeds of the pours alone"
    )


if __name__ == "__main__":
    main()
