"""Pours sets P and B, which other engines have poured too, and prints what they are compared by.

Set P is sliding friction 0.5, restitution 0.3 and a rolling torque of at most 0.3 R F_n; set B is
0.8, 0.1 and 0.1 R F_n, with R the grain's radius, at pairs and walls alike. rolling_friction counts
in R_eff, which is R / 2 at pairs: hence twice the number between grains and the number at walls.

    python examples/peers.py --set P --seeds 4
"""

import argparse

import numpy as np

import granulcal as gc

SETS = {"P": (0.5, 0.3, 0.3), "B": (0.8, 0.1, 0.1)}


def scene_of(name: str, count: int) -> gc.Scene:
    """Returns the funnel scene with the coefficients of a set."""
    sliding, rolling, restitution = SETS[name]
    material = gc.Material(
        sliding_friction=sliding, rolling_friction=2 * rolling, restitution=restitution
    )
    at_walls = {
        "ground.material.rolling_friction": rolling,
        "funnel.material.rolling_friction": rolling,
    }
    scene = gc.Scene.funnel(height=0.12).with_material(material)
    return scene.with_({**at_walls, "grains.count": float(count)})


def main() -> None:
    """Prints one row for each seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--set", choices=sorted(SETS), default="P")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--preset", default="default")
    parser.add_argument("--count", type=int, default=2000)
    options = parser.parse_args()
    scene = scene_of(options.set, options.count)
    print(
        "| seed | status | simulated s | CPU s | max z | mean z | mean r | 95 % r | penetration |"
    )
    print("|---" * 9 + "|")
    for seed in range(1, options.seeds + 1):
        pour = gc.simulate(scene, seed=seed, preset=options.preset)
        x = 1e3 * pour.positions
        r = np.hypot(*(x[:, :2] - x[:, :2].mean(axis=0)).T)
        print(
            f"| {seed} | {pour.status} | {pour.simulated_s:.2f} | {pour.cpu_seconds:.2f} "
            f"| {(x[:, 2] + 1e3 * pour.radii).max():.1f} | {x[:, 2].mean():.2f} | {r.mean():.1f} "
            f"| {np.quantile(r, 0.95):.1f} | {pour.health['worst_penetration']:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
