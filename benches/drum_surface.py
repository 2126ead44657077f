"""When the surface of the drum of `granulcal reproduce loop_drum` stands; what grains' size does.

    GRANULCAL_DATA=/path/to/measured python benches/drum_surface.py time
    GRANULCAL_DATA=/path/to/measured python benches/drum_surface.py size

`time` prints slope and heights of one pour, means over a tenth of a second or so, from the begin of
the turn on. `size` prints what pours of one material, of the same volume, are off from the pictures
by, over the diameter of their grains; grains of 1.2 mm take 1.5 to 2 minutes a pour. Heights in mm.
A pour whose overlaps are larger than its preset allows is shown with them.
"""

import argparse
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import granulcal as gc
from granulcal.experiments.loop_drum.task import RESOLUTION, at_speed, task
from granulcal.loop.task import Task

Array = NDArray[np.float64]

MATERIAL = (
    "material.sliding_friction",
    "material.rolling_friction",
    "walls.1.material.sliding_friction",
    "grains.volume",
)
"""What `--at` sets: friction of the grains and of the end walls, and the grains' volume [m^3]."""
LONG = {15: (0.3, 4.0, 0.3), 45: (0.3, 2.0, 0.15)}
"""By rounds a minute: from when, to when, and over what time a mean is [s]."""


def series(scene: gc.Scene, seed: int) -> tuple[Array, Array, float]:
    """Returns times, the statistics of each frame and the largest overlap in radii."""
    pour = gc.simulate(scene, seed=seed)
    found = [pour.series(name) for name in scene.observed_names]
    begin = scene.get("observe.begin")
    return begin + found[0][0], np.array([v for _, v in found]).T, pour.health["worst_penetration"]


def over_time(scene: gc.Scene, seed: int) -> None:
    """Prints slope and heights at both speeds, a row for each step of time."""
    for rpm, (begin, end, step) in LONG.items():
        times, values, overlap = series(scene.with_(at_speed(rpm, begin, end)), seed)
        print(f"\n{rpm} rpm, overlaps up to {overlap:.2f} radii\n")
        print("| from [s] | slope [deg] | heights |\n|---|---|---|")
        for start in np.arange(begin, end - 0.5 * step, step):
            mean = values[(times >= start) & (times < start + step)].mean(axis=0)
            heights = " ".join(f"{1e3 * z:.1f}" for z in mean[:-1:2])
            print(f"| {start:.2f} | {mean[-1]:.1f} | {heights} |", flush=True)


def over_size(
    asked: Task, scene: gc.Scene, sizes: list[float], seed: int, picture: Path | None
) -> None:
    """Prints what pours of each size of grains are off from the pictures by."""
    own = scene.get("grains.diameter")
    print("| condition | diameter [mm] | slope less measured [deg] | rms [mm] ", end="")
    print(
        "| about its mean [mm] | heights less measured | overlaps [radii] |"
        + "\n"
        + "|---" * 7
        + "|"
    )
    seen: dict[str, list[tuple[str, Array]]] = {}
    for condition in asked.conditions:
        there = scene.with_(condition.at)
        (measured,) = condition.statistics(there)
        seen[condition.name] = [("measured", measured)]
        for diameter in sizes:
            scaled = {
                path: there.get(path) * diameter**power / own**power
                for path, power in RESOLUTION.scales.items()
            }
            _, values, overlap = series(there.with_({"grains.diameter": diameter, **scaled}), seed)
            mean = values.mean(axis=0)
            seen[condition.name].append((f"grains of {1e3 * diameter:.1f} mm", mean))
            *heights, slope = mean - measured
            off = 1e3 * np.array(heights)
            cells = [f"{1e3 * diameter:.1f}", f"{slope:+.1f}", f"{np.sqrt(np.mean(off**2)):.2f}"]
            cells += [f"{off.std():.2f}", " ".join(f"{z:+.1f}" for z in off[::2]), f"{overlap:.2f}"]
            print(f"| {condition.name} | {' | '.join(cells)} |", flush=True)
    if picture is not None:
        draw(picture, scene, seen)


def draw(path: Path, scene: gc.Scene, seen: dict[str, list[tuple[str, Array]]]) -> None:
    """Draws the surfaces at each speed, the measured one in black."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    places = range(len(scene.observed_names) - 1)
    x = [1e3 * scene.get(f"observe.surface.x.{i}") for i in places]
    turn = np.linspace(0.0, 2 * np.pi, 200)
    figure, axes = plt.subplots(1, len(seen), figsize=(8.2, 4.7), sharey=True, layout="constrained")
    for axis, (name, surfaces) in zip(np.atleast_1d(axes), seen.items(), strict=True):
        axis.plot(42 * np.cos(turn), 42 * np.sin(turn), color="0.7", lw=1)
        for label, values in surfaces:
            axis.plot(x, 1e3 * values[:-1], "k.-" if label == "measured" else "-", label=label)
        axis.set(title=name, aspect="equal", xlabel="x [mm]")
        axis.legend(fontsize=8, loc="upper right")
    np.atleast_1d(axes)[0].set_ylabel("height of the free surface [mm]")
    figure.savefig(path, dpi=80)


def main() -> None:
    """Prints what was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("time", "size"))
    parser.add_argument("--sizes", type=float, nargs="+", default=[3.4e-3, 2.4e-3, 1.7e-3, 1.2e-3])
    parser.add_argument("--at", type=float, nargs=len(MATERIAL), default=[0.8, 0.1, 0.8, 2.8e-5])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--picture", type=Path, help="of size: where to draw the surfaces")
    asked = parser.parse_args()
    drum = task(Path(os.environ.get("GRANULCAL_DATA", "../shared/data/measured")))
    scene = drum.scene.with_(dict(zip(MATERIAL, asked.at, strict=True)))
    if asked.what == "time":
        over_time(scene, asked.seed)
    else:
        over_size(drum, scene, asked.sizes, asked.seed, asked.picture)


if __name__ == "__main__":
    main()
