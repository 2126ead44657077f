"""Holds what LAMMPS does with one or two grains against the closed form of every effect.

And recordings against the images of granulcal: differences from the noise-free statistics, mean and
standard deviation over pours, in standard deviations of a pour from seed to seed.

python benches/blind/check.py
"""

import math
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import effects
import numpy as np
from effects import air_drag, charge, cohesion
from engine import Pile, Setup, start
from scene import Bench

import granulcal as gc
from granulcal.pours.statistics import NAMES

FALL = 0.2
"""Time of the falls [s]."""


def grains(centres: list[list[float]], restitution: float = 0.3) -> Setup:
    """Returns a setup of these grains alone [m], far from the funnel's walls."""
    setup = Bench.load().setup(np.array([0.5, 0.3, restitution]), 0.05, 0)
    return replace(setup, centres=np.array(centres), radii=setup.radii[: len(centres)])


def applied(name: str, setup: Setup, strength: float) -> Setup:
    """Returns the setup with an effect."""
    return effects.load()[name].apply(setup, strength, np.random.default_rng(0))


def force_between(setup: Setup) -> float:
    """Returns the force on the second grain along x over its weight [-], positive if away."""
    engine, _ = start(setup)
    order = np.argsort(engine.numpy.extract_atom("id"))
    force = float(engine.numpy.extract_atom("f")[order[1], 0])
    engine.close()
    return force / setup.weight


def after(setup: Setup, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns place [m] and velocity [m/s] of the first grain after a time."""
    engine, dt = start(setup)
    engine.command(f"run {round(seconds / dt)} pre no post no")
    x, v = (np.array(engine.numpy.extract_atom(name)[0]) for name in ("x", "v"))
    engine.close()
    return x, v


def fall_in_air(setup: Setup) -> float:
    """Returns the speed after a fall in air by small steps of the equation of motion [m/s]."""
    v, mass, count = 0.0, setup.weight / 9.81, 20_000
    for _ in range(count):
        drag = air_drag.drag(np.zeros((1, 3)), np.array([[0.0, 0.0, -v]]), setup.radii[:1])[0, 2]
        v += (9.81 - drag / mass) * FALL / count
    return v


def lines() -> list[tuple[str, float, float]]:
    """Returns what is checked, LAMMPS' value and the closed form's."""
    found = []
    touch = 4e-3
    for gap in (-1e-5, 5e-5, 2e-4, 3.3e-4, 3.5e-4):
        two = grains([[0.2, 0.0, 0.2], [0.2 + touch + gap, 0.0, 0.2]])
        bare = force_between(two)
        s = max(gap, 0.0) * math.sqrt(2e-3 / (cohesion.VOLUME * 2e-3**3))
        bridge = -2.0 / (1.0 + 1.05 * s + 2.5 * s**2) if gap < 3.42e-4 else 0.0
        wet = force_between(applied("cohesion", two, 2.0)) - bare
        found.append((f"bridge of Bo 2 at a gap of {1e3 * gap:g} mm [mg]", wet, bridge))
        if gap < 1e-4:
            dry = force_between(applied("adhesion", two, 1.5)) - bare
            pull = -1.5 * (1.0 - min(1.0, max(gap, 0.0) / 4e-5))
            found.append((f"adhesion of Bo 1.5 at {1e3 * gap:g} mm [mg]", dry, pull))
    far = grains([[0.2, 0.0, 0.2], [0.21, 0.0, 0.2]])
    charged = applied("charge", far, 3.0)
    q = 3e-6 * math.pi * touch**2
    repulsion = charge.COULOMB * q**2 / 1e-4 / far.weight
    found.append(("charges of 3 uC/m2, 10 mm apart [mg]", force_between(charged), repulsion))
    one = grains([[0.2, 0.0, 0.35]])
    in_air = applied("air_drag", one, 1.0)
    found.append(
        ("speed after 0.2 s in air [m/s]", -after(in_air, FALL)[1][2], fall_in_air(in_air))
    )
    tilted = after(applied("tilt", one, 5.0), FALL)[1]
    sideways = 9.81 * FALL * math.sin(math.radians(5.0))
    found.append(("speed along a table tilted by 5 deg", math.hypot(*tilted[:2]), sideways))
    low = grains([[0.2, 0.0, 0.022]], restitution=0.5)
    hit = math.sqrt(2.0 * 9.81 * 0.02)
    contact = hit / 9.81
    back = after(applied("ground_soft", low, 0.6), contact + 4e-3)[1][2] + 9.81 * 4e-3
    found.append(("rebound from a soft ground, e_w 0.2 [-]", back / hit, 0.2))
    many = Bench.load().setup(np.array([0.5, 0.3, 0.3]), 0.05, 0)
    sizes = np.concatenate(
        [
            effects.load()["polydispersity"].apply(many, 0.25, np.random.default_rng(i)).radii
            for i in range(40)
        ]
    )
    found.append(
        ("coefficient of variation 0.25 of 20,000 grains", sizes.std() / sizes.mean(), 0.25)
    )
    found.append(("their mean volume over a grain's", (sizes**3).mean() / 2e-3**3, 1.0))
    pair = applied("clumps", grains([[0.0, 0.0, 0.0]]), 1.5)
    points = np.random.default_rng(0).uniform(-4e-3, 4e-3, (400_000, 3))
    inside = np.zeros(len(points), dtype=bool)
    for centre, radius in zip(pair.centres, pair.radii, strict=True):
        inside |= np.linalg.norm(points - centre, axis=1) < radius
    volume = inside.mean() * 8e-3**3 / (math.pi / 6.0 * touch**3)
    found.append(("volume of a clump of 1.5 over a grain's", float(volume), 1.0))
    length = float(np.linalg.norm(np.diff(pair.centres, axis=0))) + 2.0 * float(pair.radii[0])
    found.append(("its length over its breadth", length / (2.0 * float(pair.radii[0])), 1.5))
    return found


def camera(seeds: int) -> None:
    """Prints what the sensor does to the statistics: in recordings and in granulcal's own image."""
    bench, rows = Bench.load(), []
    theta = np.array([0.5, 0.3, 0.3])
    with TemporaryDirectory() as name:
        folder = Path(name)
        for seed in range(seeds):
            pour = bench.pour(theta, 0.08, seed)
            pile = Pile(pour.positions, pour.radii, 0, 0, 0.0, 0.0)
            bench.record(pile, folder, "08cm/pour.png", seed + 1000)
            recording = gc.Recording.open(folder / "08cm/pour.png", folder / "camera.toml")
            clean = bench.observe(pile.centres, pile.radii).paper16
            rows.append([clean, recording.statistics().paper16, pour.statistics().paper16])
    clean, recorded, own = np.array(rows).transpose(1, 0, 2)
    sd = clean.std(axis=0, ddof=1)
    print("\n| statistic | recording | granulcal's image |\n|---|---|---|")
    for i, name in enumerate(NAMES):
        errors = ((seen[:, i] - clean[:, i]) / sd[i] for seen in (recorded, own))
        cells = [f"{e.mean():+.2f} ± {e.std(ddof=1):.2f}" for e in errors]
        print(f"| {name} | {' | '.join(cells)} |")


def main() -> None:
    """Prints a table of forces and motions, and one of what the sensor adds."""
    print("| what | LAMMPS | closed form |\n|---|---|---|")
    for what, theirs, form in lines():
        print(f"| {what} | {theirs:.4f} | {form:.4f} |")
    camera(seeds=20)


if __name__ == "__main__":
    main()
