"""What the softening of LAMMPS' grains changes: piles of one material at several moduli.

python benches/blind/stiffness.py --seeds 6
"""

import argparse

import engine
import numpy as np
from scene import Bench

MODULI = (1e7, 3e6, 1e6)
"""Young's moduli [Pa]."""
MATERIAL, HEIGHT = (0.5, 0.3, 0.3), 0.08
"""mu_s, mu_r, e [-] and the height of the tip [m]."""


def main() -> None:
    """Prints mean and standard deviation over seeds; lengths in mm over centres."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6)
    options = parser.parse_args()
    bench = Bench.load()
    print("| E Pa | CPU s | mean z | max z | mean r | 95 % r |\n|---|---|---|---|---|---|")
    for young in MODULI:
        engine.YOUNG = young
        rows = []
        for seed in range(options.seeds):
            pile = engine.pour(bench.setup(np.array(MATERIAL), HEIGHT, seed))
            x = 1e3 * pile.centres
            r = np.hypot(*(x[:, :2] - x[:, :2].mean(axis=0)).T)
            measures = x[:, 2].mean(), x[:, 2].max(), r.mean(), np.quantile(r, 0.95)
            rows.append([pile.cpu_s, *measures])
        mean, sd = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1)
        cells = [f"{m:.2f} ± {s:.2f}" for m, s in zip(mean[1:], sd[1:], strict=True)]
        print(f"| {young:g} | {mean[0]:.1f} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
