"""What the two engines differ by without any effect, as tolerances of the loop.

    python benches/blind/tolerances.py OUT.json

Reads code_difference.json and code_difference.csv: the mean difference is one direction, and the
leading differences from material to material are others, less what the seeds of the pours put in.
"""

import argparse
import csv
import json
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
LEFT_OUT = ("tail_index", "ring_depth", "height_ring")
"""Statistics that the loop does not look at."""


def main() -> None:
    """Writes the tolerances."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument(
        "--directions", type=int, default=6, help="of the scatter between materials, at most"
    )
    parser.add_argument(
        "--with-seeds", action="store_true", help="leave in what the seeds of the pours put in"
    )
    options = parser.parse_args()
    out: Path = options.out
    numbers = json.loads((HERE / "code_difference.json").read_text())
    heights = sorted(numbers["heights"], key=float)
    every = [*numbers["names"], *numbers["diagnostic_names"]]
    names = [name for name in every if not name.startswith(LEFT_OUT)]
    keep = [every.index(name) for name in names]
    sd = np.array(
        [[*numbers["heights"][h]["sd"], *numbers["heights"][h]["diagnostic_sd"]] for h in heights]
    )[:, keep]
    with (HERE / "code_difference.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    materials = sorted({row["material"] for row in rows}, key=int)
    values = np.full((len(materials), len(heights), len(names)), np.nan)
    for row in rows:
        place = materials.index(row["material"]), heights.index(row["height"])
        values[place] = [float(row[name]) for name in names]
    whole = np.isfinite(values).all(axis=(1, 2))
    flat = values[whole].reshape(whole.sum(), -1)
    mean = flat.mean(axis=0)
    # In units of the scatter between seeds, of which a pour less a mean of six has 7/6.
    _, singular, axes = np.linalg.svd(flat - mean, full_matrices=False)
    variances = singular**2 / (len(flat) - 1)
    noise = 7 / 6 * flat.shape[1] / max(len(flat) - 1, 1)
    found = [mean]
    print("variance between materials over that of seeds:", (variances / noise).round(2))
    for variance, axis in zip(variances[: options.directions], axes, strict=False):
        left = variance if options.with_seeds else variance - noise
        if left > 0:
            found.append(np.sqrt(left) * axis)
    directions = [(d.reshape(len(heights), -1) * sd).tolist() for d in found]
    document = {
        "names": names,
        "path": "funnel.height",
        "at": [float(h) for h in heights],
        "directions": directions,
    }
    out.write_text(json.dumps(document) + "\n", encoding="utf-8")
    print(f"{len(found)} directions of {whole.sum()} materials written to {out}")


if __name__ == "__main__":
    main()
