"""Makes the recordings of `granulcal reproduce paper heights`: pours of grains in LAMMPS.

    python benches/paper/recordings.py out/paper/recordings

Recordings that are there are not made again, so it goes on where it was stopped. The grains:
couscous, spheres whose diameters have a coefficient of variation of 8 %; barley, rigid pairs of
spheres half as long again as broad. Sliding friction and restitution are those that the paper found
of both, rolling friction is 0.1. The funnel is that of `granulcal.Scene.funnel`.
"""

import argparse
import sys
import time
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "blind"))
import effects
from engine import Pile, Setup, pour
from scene import setup_of

import granulcal as gc

GRAINS = {
    "couscous": ((0.6687, 0.1, 0.7689), ("polydispersity", 0.08)),
    "barley": ((0.3807, 0.1, 0.4792), ("clumps", 1.5)),
}
"""Sliding friction, rolling friction and restitution; what makes the grains no equal spheres."""
CALIBRATED_AT, HEIGHTS = 0.12, (0.02, 0.04, 0.06, 0.08, 0.10)
"""Heights of the funnel's tip [m]."""
UNIT = 1e-5
"""Of the stored lengths [m]: a hundredth of a millimetre."""


def setup(scene: gc.Scene, material: tuple[float, float, float], height: float, seed: int) -> Setup:
    """Returns a pour of equal spheres in LAMMPS, started as in the scene."""
    return setup_of(tomllib.loads(scene.to_toml()), material, height, seed)


def stored(pile: Pile, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns centres (n, 3) and radii (n,) in units of 10 um; -1 for spheres that left."""
    centres = np.full((count, 3), -1, np.int32)
    centres[: len(pile.centres)] = np.rint(pile.centres / UNIT).clip(min=[-(2**30)] * 2 + [0])
    radii = np.zeros(count, np.int32)
    radii[: len(pile.radii)] = np.rint(pile.radii / UNIT)
    return centres, radii


def main() -> None:
    """Makes what is missing."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path, help="folder")
    parser.add_argument("--grains", type=int, default=2000, help="of a pour (default: 2000)")
    parser.add_argument("--counts", type=int, nargs=2, default=(10, 5), metavar=("AT_12", "ELSE"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    scene = gc.Scene.funnel(count=options.grains)
    wanted = [(CALIBRATED_AT, seed) for seed in range(options.counts[0])]
    wanted += [(height, seed) for height in HEIGHTS for seed in range(options.counts[1])]
    for name, (material, (effect, strength)) in GRAINS.items():
        path = options.out / f"{name}.npz"
        kept = {}
        if path.exists():
            with np.load(path) as file:
                kept = {key: list(file[key]) for key in file.files}
        made = len(kept.get("heights", []))
        for number, (height, seed) in enumerate(wanted[made:], start=made):
            began = time.monotonic()
            # One sample of grains for all pours, as one bag of them.
            of_grains = np.random.default_rng(7)
            plain = setup(scene, material, height, 1000 + 17 * seed + round(1e3 * height))
            poured = effects.load()[effect].apply(plain, strength, of_grains)
            pile = pour(replace(poured))
            centres, radii = stored(pile, len(poured.radii))
            row = {"heights": height, "held": pile.held, "positions": centres, "radii": radii}
            for key, value in row.items():
                kept.setdefault(key, []).append(value)
            beside = path.with_suffix(".part.npz")
            np.savez_compressed(beside, **{key: np.array(value) for key, value in kept.items()})
            beside.replace(path)
            took = time.monotonic() - began
            left = took * (len(wanted) - number - 1)
            print(
                f"{name} {number + 1}/{len(wanted)}: {took:.0f} s, {pile.held} held, "
                f"{left / 60:.0f} min left",
                flush=True,
            )


if __name__ == "__main__":
    main()
