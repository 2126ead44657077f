"""Pours of one model under every condition: what a verdict is held against. None is run twice."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.loop.measures import Measures
from granulcal.scene import Scene
from granulcal.simulate import simulate

__all__ = ["UNUSABLE", "Forward"]

Array = NDArray[np.float64]

UNUSABLE = ("unhealthy", "jammed")
"""Statuses of pours that nothing is learnt from."""


class Forward:
    """Runs pours and keeps their statistics, by scene and seed.

    Args:
        folder: of the kept ones.
        threads: pours at once.
    """

    def __init__(self, folder: Path, threads: int) -> None:
        """Begins or goes on with a folder."""
        self.folder, self.threads = folder, threads
        self.ran = 0
        folder.mkdir(parents=True, exist_ok=True)

    def pours(
        self, scene: Scene, seeds: Sequence[int], faults: Mapping[str, float] | None = None
    ) -> Array:
        """Returns the statistics of usable pours, shape (n <= len(seeds), s).

        `faults` are those of the image, by kind.
        """
        names = Measures.of(scene).names
        of = [_native.__version__, names, scene.to_toml(), list(seeds)]
        text = json.dumps([*of, dict(faults)] if faults else of)
        path = self.folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.npy"
        if path.exists():
            return np.load(path)
        with ThreadPoolExecutor(self.threads) as pool:
            made = pool.map(lambda seed: _row(scene, seed, faults), seeds)
            rows = [row for row in made if row is not None]
        self.ran += len(seeds)
        found = np.array(rows).reshape(len(rows), len(names))
        beside = path.with_suffix(".part.npy")
        np.save(beside, found)
        beside.replace(path)
        return found


def _row(scene: Scene, seed: int, faults: Mapping[str, float] | None) -> Array | None:
    pour = simulate(scene, seed=seed)
    if pour.status in UNUSABLE:
        return None
    try:
        found = Measures.of(scene).of_pour(pour, faults)
    except ValueError:
        # Too few grains in view.
        return None
    return found if np.isfinite(found).all() else None
