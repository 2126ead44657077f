"""What pours in other engines share: the start, when a pour ends, the CSV of piles."""

import csv
from pathlib import Path

import numpy as np

KEY = ("row", "settings", "young", "seed")
PILE = ("rest_s", "cpu_s", "max_z", "mean_z", "mean_r", "r95", "worst_overlap", "held", "lost")

SLOW = 0.01
"""Speed below which a grain counts as resting [m/s]."""
RESTING = 0.995
"""Share of the grains that must be slow at the end of a pour [-]."""
FALLEN = 0.6
"""Nothing rests before the last grain has fallen [s]."""
NECK, RIM = 0.13, 0.2
"""Heights between which the funnel's cone stands [m]."""


def start(seed: int) -> np.ndarray:
    """Returns the centres of the 2000 grains at the start, those of `Scene.funnel(0.12)` [m]."""
    jitter = np.random.default_rng(seed).uniform(-1e-4, 1e-4, (2000, 3))
    z, y, x = np.indices((20, 10, 10)).reshape(3, -1)
    corner = np.array([-0.036, -0.036, RIM - 4e-3])
    return 8e-3 * np.stack([x, y, z], axis=1) + corner + jitter


def is_at_rest(time: float, velocities: np.ndarray) -> bool:
    """Returns whether a pour has ended at `time` [s], with velocities of shape (n, 3) [m/s]."""
    return time > FALLEN and (np.linalg.norm(velocities, axis=1) < SLOW).mean() > RESTING


def done(results: Path) -> set[tuple[str, ...]]:
    """Returns the keys of the pours in a CSV."""
    if not results.exists():
        return set()
    with results.open() as file:
        return {tuple(row[name] for name in KEY) for row in csv.DictReader(file)}


def append(results: Path, key: tuple[str, ...], result: dict[str, float]) -> None:
    """Adds a pour to a CSV and prints it."""
    fresh = not results.exists()
    with results.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if fresh:
            writer.writerow(KEY + PILE)
        writer.writerow([*key, *(f"{result[field]:.4g}" for field in PILE)])
    print(*key, *(f"{field} {result[field]:.4g}" for field in PILE), flush=True)
