"""One grain that falls on a heap, in LAMMPS and in granulcal: the same heap, the same places.

    python benches/blind/splash.py --places 40

The heap is what granulcal leaves of scene.toml. In LAMMPS it settles for 0.22 s before it is
struck, while the grain is still in the air; in granulcal it is at rest. Ways in mm from the moment
of the blow to 0.4 s after it, mean and standard error over places; `rest` is the heap without one.
`striker` is the way of the grain that falls, `sum` that of all others.
"""

import argparse
from dataclasses import replace

import engine
import numpy as np
from numpy.typing import NDArray
from scene import PARAMETERS, SCENE, Bench
from stiffness import HEIGHT, MATERIAL, PRESETS, show

import granulcal as gc

Array = NDArray[np.float64]

FALL, TOSS = 0.08, 1.0
"""Height of the fall [m]; speed at which the grain is tossed up to it [m/s]."""
AFTER = 0.4
"""Time from the blow to the look [s]."""
INNER = 0.025
"""Radius of the disc over which the places are spread [m]."""
STIFFNESSES = ((3e6, 0.1), (3e7, 0.1))
"""Young's modulus [Pa]; step over the time of a Rayleigh wave [-]."""
G = 9.81


def blows(centres: Array, radius: float, places: int) -> list[Array]:
    """Returns the grain's centre [m] where it touches: a sunflower over the heap's middle."""
    middle = centres[:, :2].mean(axis=0)
    found = []
    for place in range(places):
        angle = np.pi * (3.0 - np.sqrt(5.0)) * place
        out = INNER * np.sqrt((place + 0.5) / places)
        xy = middle + out * np.array([np.cos(angle), np.sin(angle)])
        apart = np.linalg.norm(centres[:, :2] - xy, axis=1)
        near = apart < 2.0 * radius
        tops = centres[near, 2] + np.sqrt(4.0 * radius**2 - apart[near] ** 2)
        found.append(np.array([*xy, tops.max(initial=radius)]))
    return found


def in_lammps(bench: Bench, centres: Array, blow: Array | None) -> Array:
    """Returns the ways [m] since the blow in LAMMPS, shape (n,), the striker's last."""
    setup = bench.setup(np.array(MATERIAL), HEIGHT, 0)
    radius = float(setup.radii[0])
    count = len(centres)
    if blow is not None:
        # Tossed up from below the top of its way, so that the heap has time to settle.
        above = np.array([0.0, 0.0, FALL - TOSS**2 / (2.0 * G)])
        centres = np.vstack([centres, blow + above])
    # No funnel is near.
    funnel = replace(setup.funnel, height=0.25)
    radii = np.full(len(centres), radius)
    lammps, dt = engine.start(replace(setup, centres=centres, radii=radii, funnel=funnel))
    try:
        if blow is not None:
            lammps.numpy.extract_atom("v")[_places(lammps)[-1]] = [0.0, 0.0, TOSS]
        in_air = TOSS / G + np.sqrt(2.0 * FALL / G)
        lammps.command(f"run {round((in_air - 5e-4) / dt)} post no")
        before = np.array(lammps.numpy.extract_atom("x")[_places(lammps)])
        if blow is not None:
            before[-1] = blow
        lammps.command(f"run {round(AFTER / dt)} post no")
        after = np.array(lammps.numpy.extract_atom("x")[_places(lammps)])
    finally:
        lammps.close()
    assert len(after) == count + (blow is not None), "a grain was lost"
    return np.linalg.norm(after - before, axis=1)


def _places(lammps: engine.lammps) -> NDArray[np.int64]:
    """Returns where each grain is in LAMMPS' arrays, which it sorts."""
    count = lammps.extract_setting("nlocal")
    return np.argsort(lammps.numpy.extract_atom("id")[:count])


def measures(ways: Array, radius: float, rest: float) -> list[float]:
    """Returns a row of the table from the ways [m] of one blow, the striker's last."""
    struck, striker = ways[:-1], ways[-1]
    far, some = (float((struck > way).sum()) for way in (radius, 1e-4))
    return [1e3 * striker, far, some, 1e3 * struck.sum(), 1e3 * rest]


def in_granulcal(centres: Array, preset: str, blow: Array | None) -> Array:
    """Returns the same of granulcal; the grain falls from rest."""
    start = centres if blow is None else np.vstack([centres, blow + np.array([0.0, 0.0, FALL])])
    table = {f"material.{name}": value for name, value in zip(PARAMETERS, MATERIAL, strict=True)}
    text = SCENE.read_text()
    rows = ", ".join(f"[{x:.17g}, {y:.17g}, {z:.17g}]" for x, y, z in start)
    text = text.replace(f"count = {len(centres)}\n", f"count = {len(start)}\n")
    head, tail = text.index("[start]"), text.index("[end]")
    text = f'{text[:head]}[start]\nkind = "positions"\npositions = [{rows}]\n\n{text[tail:]}'
    # To the horizon, whatever rests: both engines are looked at at one time.
    horizon = float(np.sqrt(2.0 * FALL / G)) + AFTER
    scene = gc.Scene.from_toml(text).with_({**table, "preset": preset, "end.horizon": horizon})
    after = gc.simulate(scene, seed=1).positions
    before = centres if blow is None else np.vstack([centres, blow])
    return np.linalg.norm(after - before, axis=1)


def main() -> None:
    """Prints the table, a row as soon as its blows are done."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=40)
    options = parser.parse_args()
    bench = Bench.load()
    pile = bench.pour(np.array(MATERIAL), HEIGHT, 1)
    centres, radius = pile.positions, float(pile.radii[0])
    at = blows(centres, radius, options.places)
    print("| engine | blows | striker | moved > R | > 0.1 mm | sum | rest |\n" + "|---" * 7 + "|")
    for preset in PRESETS:
        rest = in_granulcal(centres, preset, None).sum()
        ways = [in_granulcal(centres, preset, blow) for blow in at]
        show(f"`{preset}`", [measures(way, radius, rest) for way in ways])
    for young, step in STIFFNESSES:
        engine.YOUNG, engine.STEP = young, step
        rest = in_lammps(bench, centres, None).sum()
        ways = [in_lammps(bench, centres, blow) for blow in at]
        rows = [measures(way, radius, rest) for way in ways]
        show(f"LAMMPS, E {young:.0e} Pa, step {step:g}", rows)


if __name__ == "__main__":
    main()
