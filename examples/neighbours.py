"""Counts neighbours of grains deep in a settled column: a packing, in docs/theory/effects.md.

    python examples/neighbours.py

Two grains are neighbours if the gap between them is less than a quarter of a radius.
"""

from pathlib import Path

import numpy as np
from scipy.spatial import KDTree

import granulcal as gc

SCENE = Path(__file__).with_name("column.toml")


def main() -> None:
    """Prints a line for each of two materials."""
    for sliding, rolling in ((0.5, 0.1), (0.2, 0.01)):
        # A tube that is not lifted before the end.
        scene = gc.Scene.load(SCENE).with_(
            {
                "material.sliding_friction": sliding,
                "material.rolling_friction": rolling,
                "walls.0.motion.begin": 0.9,
                "walls.0.motion.end": 1.2,
            }
        )
        pour = gc.simulate(scene, seed=1)
        places, diameter = np.asarray(pour.positions), 2 * pour.radii[0]
        near = KDTree(places).query_ball_point(places, 1.125 * diameter, return_length=True) - 1
        out, height = np.hypot(places[:, 0], places[:, 1]), places[:, 2]
        is_deep = (out < 0.6 * np.quantile(out, 0.95)) & (height > 2 * diameter)
        is_deep &= height < 0.7 * height.max()
        print(
            f"sliding friction {sliding}, rolling friction {rolling}: "
            f"{near[is_deep].mean():.2f} neighbours of {is_deep.sum()} grains"
        )


if __name__ == "__main__":
    main()
