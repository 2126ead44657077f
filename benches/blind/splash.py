"""One grain that falls on a heap, in LAMMPS and in granulcal: the same heap, the same places.

    python benches/blind/splash.py --places 40

The heap is what granulcal leaves of scene.toml. In LAMMPS it settles for 0.22 s before it is
struck, while the grain is still in the air; in granulcal it is at rest. Ways in mm from the moment
of the blow to 0.4 s after it, mean and standard error over places; `rest` is the heap without one.
`striker` is the way of the grain that falls, `sum` that of all others.
"""

import argparse
from dataclasses import dataclass, replace

import engine
import numpy as np
from numpy.typing import NDArray
from scene import PARAMETERS, SCENE, Bench

import granulcal as gc

Array = NDArray[np.float64]

MATERIAL, HEIGHT = (0.5, 0.3, 0.3), 0.08
"""mu_s, mu_r, e [-] and the height of the tip [m]."""
FALL, TOSS = 0.08, 1.0
"""Height of the fall [m]; speed at which the grain is tossed up to it [m/s]."""
AFTER = 0.4
"""Time from the blow to the look [s]."""
INNER = 0.025
"""Radius of the disc over which the places are spread [m]."""
STIFFNESSES = ((3e6, 0.1), (3e7, 0.1))
"""Young's modulus [Pa]; step over the time of a Rayleigh wave [-]."""
G = 9.81


@dataclass(frozen=True)
class Blow:
    """Where a grain touches the heap [m]: its centre, shape (3,)."""

    at: Array


def heap(bench: Bench) -> gc.Pour:
    """Returns granulcal's heap."""
    return bench.pour(np.array(MATERIAL), HEIGHT, 1)


def blows(centres: Array, radius: float, places: int) -> list[Blow]:
    """Returns where the grain touches: a sunflower of places over the middle of the heap."""
    middle = centres[:, :2].mean(axis=0)
    found = []
    for place in range(places):
        angle = np.pi * (3.0 - np.sqrt(5.0)) * place
        out = INNER * np.sqrt((place + 0.5) / places)
        xy = middle + out * np.array([np.cos(angle), np.sin(angle)])
        apart = np.linalg.norm(centres[:, :2] - xy, axis=1)
        near = apart < 2.0 * radius
        tops = centres[near, 2] + np.sqrt(4.0 * radius**2 - apart[near] ** 2)
        found.append(Blow(np.array([*xy, tops.max(initial=radius)])))
    return found


def in_lammps(bench: Bench, centres: Array, blow: Blow | None) -> Array:
    """Returns the ways [m] since the blow in LAMMPS, shape (n,), the striker's last."""
    setup = bench.setup(np.array(MATERIAL), HEIGHT, 0)
    radius = float(setup.radii[0])
    count = len(centres)
    if blow is not None:
        # Tossed up from below the top of its way, so that the heap has time to settle.
        above = np.array([0.0, 0.0, FALL - TOSS**2 / (2.0 * G)])
        centres = np.vstack([centres, blow.at + above])
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
            before[-1] = blow.at
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


def show(name: str, ways: list[Array], radius: float, rest: float) -> None:
    """Prints a row of the table."""
    struck = np.array(ways)[:, :-1]
    far, some = ((struck > way).sum(axis=1) for way in (radius, 1e-4))
    strikers = np.array([way[-1] for way in ways])
    rows = np.column_stack([1e3 * strikers, far, some, 1e3 * struck.sum(axis=1)])
    mean, error = rows.mean(axis=0), rows.std(axis=0, ddof=1) / np.sqrt(len(rows))
    cells = [f"{m:.3g} ± {s:.1g}" for m, s in zip(mean, error, strict=True)]
    print(f"| {name} | {' | '.join(cells)} | {1e3 * rest:.2g} |", flush=True)


def in_granulcal(centres: Array, preset: str, blow: Blow | None) -> Array:
    """Returns the same of granulcal; the grain falls from rest."""
    start = centres if blow is None else np.vstack([centres, blow.at + np.array([0.0, 0.0, FALL])])
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
    before = centres if blow is None else np.vstack([centres, blow.at])
    return np.linalg.norm(after - before, axis=1)


def main() -> None:
    """Prints the table, a row as soon as its blows are done."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=40)
    options = parser.parse_args()
    bench = Bench.load()
    pile = heap(bench)
    centres, radius = pile.positions, float(pile.radii[0])
    at = blows(centres, radius, options.places)
    print("| engine | striker | moved > R | > 0.1 mm | sum | rest |\n|---|---|---|---|---|---|")
    for preset in ("default", "accurate"):
        rest = in_granulcal(centres, preset, None).sum()
        ways = [in_granulcal(centres, preset, blow) for blow in at]
        show(f"`{preset}`", ways, radius, rest)
    for young, step in STIFFNESSES:
        engine.YOUNG, engine.STEP = young, step
        rest = in_lammps(bench, centres, None).sum()
        ways = [in_lammps(bench, centres, blow) for blow in at]
        show(f"LAMMPS, E {young:.0e} Pa, step {step:g}", ways, radius, rest)


if __name__ == "__main__":
    main()
