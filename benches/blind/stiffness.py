"""Heaps of one material in LAMMPS at several stiffnesses, and ours beside them.

python benches/blind/stiffness.py --seeds 6

Lengths in mm over centres, r about their centroid; mean and standard error over seeds.
`two supports` is the share of the grains above the ground that rest on two others.
"""

import argparse

import engine
import numpy as np
from numpy.typing import NDArray
from scene import PARAMETERS, SCENE, Bench
from scipy.spatial import cKDTree

import granulcal as gc

STIFFNESSES = ((3e6, 0.2), (3e7, 0.05), (3e8, 0.1))
"""Young's modulus [Pa]; step over the time of a Rayleigh wave [-]; rolling springs: 0.25 a step."""
PRESETS = ("default", "accurate")
MATERIAL, HEIGHT = (0.5, 0.3, 0.3), 0.08
"""mu_s, mu_r, e [-] and the height of the tip [m]."""
DIAMETER = 4.0
"""Of a grain [mm]."""
MEASURES = ("mean z", "max z", "sd z", "mean r", "95 % r", "two supports")


def supports(x: NDArray[np.float64]) -> NDArray[np.int64]:
    """Returns how many grains each grain rests on; centres `x` [mm], shape (n, 3)."""
    pairs = cKDTree(x).query_pairs(1.015 * DIAMETER, output_type="ndarray")
    upper = np.where(x[pairs[:, 0], 2] > x[pairs[:, 1], 2], pairs[:, 0], pairs[:, 1])
    is_above = np.abs(x[pairs[:, 0], 2] - x[pairs[:, 1], 2]) > 0.05 * DIAMETER
    return np.bincount(upper[is_above], minlength=len(x))


def measure(centres: NDArray[np.float64]) -> list[float]:
    """Returns the MEASURES of a heap; centres [m], shape (n, 3)."""
    x = 1e3 * centres
    r = np.hypot(*(x[:, :2] - x[:, :2].mean(axis=0)).T)
    above = x[:, 2] > 0.575 * DIAMETER
    on_two = (supports(x)[above] == 2).mean()
    z = x[:, 2]
    return [z.mean(), z.max(), z.std(), r.mean(), float(np.quantile(r, 0.95)), on_two]


def show(name: str, heaps: list[list[float]]) -> None:
    """Prints a row of a table: the number of rows of measures, their means and standard errors."""
    mean, error = np.mean(heaps, axis=0), np.std(heaps, axis=0, ddof=1) / np.sqrt(len(heaps))
    cells = [f"{m:.3g} ± {s:.1g}" for m, s in zip(mean, error, strict=True)]
    print(f"| {name} | {len(heaps)} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Prints the table, a row as soon as its heaps are poured."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6)
    options = parser.parse_args()
    bench = Bench.load()
    print(f"| engine | pours | {' | '.join(MEASURES)} |\n|{'---|' * (2 + len(MEASURES))}")
    values = {f"material.{name}": value for name, value in zip(PARAMETERS, MATERIAL, strict=True)}
    for preset in PRESETS:
        scene = gc.Scene.from_toml(SCENE.read_text()).with_({**values, "funnel.height": HEIGHT})
        scene = scene.with_(preset=preset)
        pours = [gc.simulate(scene, seed=seed) for seed in range(4 * options.seeds)]
        show(f"`{preset}`", [measure(pour.positions) for pour in pours])
    for young, step in STIFFNESSES:
        engine.YOUNG, engine.STEP = young, step
        setups = (bench.setup(np.array(MATERIAL), HEIGHT, seed) for seed in range(options.seeds))
        heaps = [measure(engine.pour(setup).centres) for setup in setups]
        show(f"LAMMPS, E {young:.0e} Pa, step {step:g}", heaps)


if __name__ == "__main__":
    main()
