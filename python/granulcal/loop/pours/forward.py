"""Pours of one model under every condition: what a verdict is held against. None is run twice."""

import contextlib
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import read_array
from granulcal.engines.in_use import law_of_pours, version_of_pours
from granulcal.loop.pours.measures import Measures
from granulcal.pours.at_once import at_once
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.pours.status import UNUSABLE
from granulcal.pours.store import PourStore
from granulcal.progress import steps

__all__ = ["Coarse", "Forward"]

Array = NDArray[np.float64]

# From one of the pours that are averaged to the next.
_REPEAT_STEP = 1_000_000_007


class Forward:
    """Runs pours and keeps their statistics, by scene and seed.

    Args:
        folder: of the kept ones.
        threads: pours at once.
    """

    def __init__(self, folder: Path, threads: int) -> None:
        """Begins or goes on with a folder."""
        self.store = PourStore(folder, threads)
        self.ran = 0
        folder.mkdir(parents=True, exist_ok=True)

    def pours(
        self, scene: Scene, seeds: Sequence[int], faults: Mapping[str, float] | None = None
    ) -> Array:
        """Returns the statistics of usable pours, shape (n <= len(seeds), s).

        `faults` are those of the image, by kind.
        """
        key = _key(scene, seeds, faults)
        kept = self._kept(key)
        if kept is not None:
            return kept
        found = self._whole(scene, self.store.make(partial(_row, scene, faults), seeds))
        self.ran += len(seeds)
        self.store.keep(key, {"found": found})
        return found

    def fill(self, what: str, asked: Sequence[tuple[Scene, Sequence[int]]]) -> None:
        """Makes and keeps what `pours` would be asked for one after the other, several at once.

        Args:
            what: names the steps of the progress.
            asked: scenes and the seeds of each.
        """
        missing = [one for one in asked if self._kept(_key(*one)) is None]
        made = at_once(_rows, missing, self.store.threads)
        for _ in steps(what, missing):
            place, rows = next(made)
            scene, seeds = missing[place]
            self.ran += len(seeds)
            self.store.keep(_key(scene, seeds), {"found": self._whole(scene, rows)})

    def _kept(self, key: str) -> Array | None:
        kept = self.store.read(key)
        if kept is not None and "found" in kept:
            return kept["found"]
        older = self.store.folder / f"{key}.npy"
        if older.exists():
            # Of before there was a checksum; what is damaged is made again.
            with contextlib.suppress(ValueError):
                return read_array(older)
        return None

    @staticmethod
    def _whole(scene: Scene, made: Sequence[Array | None]) -> Array:
        rows = [row for row in made if row is not None]
        return np.array(rows).reshape(len(rows), len(Measures.of(scene).names))

    def limit(
        self,
        scene: Scene,
        seeds: Sequence[int],
        faults: Mapping[str, float] | None = None,
        coarse: "Coarse | None" = None,
    ) -> Array:
        """Returns the pours in the limit of the real grains' size, shape (n <= len(seeds), s).

        Pours at the scene's size and at the coarse one, `x_1 + psi (x_2 - x_1)`, each the mean of
        so many that it scatters as one pour does; with no coarse size those of the scene.
        """
        if coarse is None:
            return self.pours(scene, seeds, faults)
        repeated = [seed + _REPEAT_STEP * i for seed in seeds for i in range(coarse.repeats)]
        fine = self.pours(scene, repeated, faults)
        other = self.pours(scene.with_(coarse.numbers), repeated, faults)
        count = min(len(fine), len(other)) // coarse.repeats
        fine, other = (
            rows[: count * coarse.repeats].reshape(count, coarse.repeats, -1).mean(axis=1)
            for rows in (fine, other)
        )
        return fine + coarse.held * (other - fine)


@dataclass(frozen=True)
class Coarse:
    """The second size of grains, and where the real ones lie.

    Attributes:
        numbers: of the scene with coarse grains, by path.
        held: psi of the real size, 0 at the scene's and 1 at the coarse one.
    """

    numbers: dict[str, float]
    held: float

    @property
    def repeats(self) -> int:
        """Pours at each size whose mean, taken to the limit, scatters no more than one pour."""
        return ceil((1 - self.held) ** 2 + self.held**2)


def _key(scene: Scene, seeds: Sequence[int], faults: Mapping[str, float] | None = None) -> str:
    """The name of a group among the kept ones."""
    names = Measures.of(scene).names
    of = [version_of_pours(), law_of_pours(scene), names, scene.to_toml(), list(seeds)]
    text = json.dumps([*of, dict(faults)] if faults else of)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _rows(asked: tuple[Scene, Sequence[int]]) -> list[Array | None]:
    scene, seeds = asked
    return [_row(scene, None, seed) for seed in seeds]


def _row(scene: Scene, faults: Mapping[str, float] | None, seed: int) -> Array | None:
    pour = simulate(scene, seed=seed)
    if pour.status in UNUSABLE:
        return None
    try:
        found = Measures.of(scene).of_pour(pour, faults)
    except ValueError:
        # Too few grains in view.
        return None
    return found if np.isfinite(found).all() else None
