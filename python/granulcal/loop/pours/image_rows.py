"""Pours whose image is read again under the effects of the image: one pour serves them all.

Base pours are read plainly, under each effect of the image, and under each two of them. They are
pours of the plain model as well and count among them: the archive's folder `images/`. Pours with an
effect that is poured, which count among that effect's, are read under it and each effect of the
image: `images-NAME/`. So the surrogate sees what two effects do together.

Chunks of pours hold for each its parameters, and strengths and statistics of each reading. A chunk
is whole or absent, and is made again where an effect has been added.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.rows import Rows
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.pours.status import UNUSABLE
from granulcal.pours.store import PourStore
from granulcal.prior import Prior

__all__ = ["ImageRows"]

Array = NDArray[np.float64]

_CHUNK = 16
# Of the random numbers, apart from those of every other part.
_STREAM = 5
# Share of the pours that each effect reads again: readings of a pour share its noise, and more of
# them would tell little more.
_SHARE = 0.5
# The same of each two effects.
_TWO_SHARE = 0.2


@dataclass(frozen=True)
class ImageRows:
    """Pours of one model, read under effects of the image.

    Attributes:
        folder: of the chunks.
        scene: the base scene.
        prior: of the material.
        conditions: path and range of each condition input, q of them.
        places: numbers of each condition, where pours are at these alone; else empty.
        effects: of the image.
        count: pours.
        seed: of all of them.
        poured: effect that the pours have; None for the base model's.
    """

    folder: Path
    scene: Scene
    prior: Prior
    conditions: tuple[tuple[str, float, float], ...]
    places: tuple[dict[str, float], ...]
    effects: tuple[LibraryEffect, ...]
    count: int
    seed: int
    poured: LibraryEffect | None = None

    @property
    def readings(self) -> tuple[tuple[LibraryEffect, ...], ...]:
        """Effects of the image in each reading; () is none."""
        alone = tuple((effect,) for effect in self.effects)
        if self.poured is not None:
            # Read plainly as well it would be copied once more, and tell nothing of two effects.
            return alone
        return ((), *alone, *combinations(self.effects, 2))

    @property
    def missing(self) -> int:
        """Pours that are not there yet, in whole chunks."""
        return sum(len(self._of(chunk)) for chunk in self._missing)

    def fill(self, *, threads: int, say: Callable[[str], None] = print) -> None:
        """Pours what is missing."""
        missing = self._missing
        if missing:
            of = f" of {self.poured.name}" if self.poured else ""
            count = sum(len(self._of(chunk)) for chunk in missing)
            say(f"images{of}: {count} pours, read under {len(self.effects)} effects")
        store = PourStore(self.folder, threads)
        for chunk in missing:
            rows = store.make(self._row, self._of(chunk))
            store.keep(_name(chunk), {k: np.array([row[k] for row in rows]) for k in rows[0]})

    def rows(self) -> Iterator[tuple[tuple[str, ...], Rows]] | None:
        """Returns the usable readings and the effects of each; None if pours are missing.

        Columns of psi are the strengths of these effects, the poured one's first.
        """
        chunks = [self._read(chunk) for chunk in range(self._chunks)]
        whole = [chunk for chunk in chunks if chunk is not None]
        return self._readings(whole) if len(whole) == len(chunks) else None

    def _readings(self, chunks: list[dict[str, Array]]) -> Iterator[tuple[tuple[str, ...], Rows]]:
        first = () if self.poured is None else (self.poured.name,)
        for reading in self.readings if chunks else ():
            key = _key(reading)
            parts = []
            for found in chunks:
                x = found[f"x/{key}"]
                # Before there were readings of two effects, strengths were numbers.
                psi = found[f"psi/{key}"].reshape(len(x), -1)[:, : len(reading)]
                if self.poured is not None:
                    psi = np.column_stack([found["poured"], psi])
                rows = Rows(found["theta"], found["condition"], psi, x)
                parts.append(rows.taken(np.all(np.isfinite(x), axis=1)))
            yield (*first, *(effect.name for effect in reading)), Rows.joined(parts)

    @property
    def _chunks(self) -> int:
        return -(-self.count // _CHUNK)

    def _of(self, chunk: int) -> range:
        """The pours of a chunk, by number."""
        return range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, self.count))

    @property
    def _missing(self) -> list[int]:
        return [i for i in range(self._chunks) if self._read(i) is None]

    def _read(self, chunk: int) -> dict[str, Array] | None:
        found = PourStore(self.folder).read(_name(chunk))
        if found is None or "theta" not in found:
            return None
        wanted = len(self._of(chunk))
        is_whole = all(f"x/{_key(reading)}" in found for reading in self.readings)
        return (
            {k: v[:wanted] for k, v in found.items()}
            if is_whole and len(found["theta"]) >= wanted
            else None
        )

    def _row(self, row: int) -> dict[str, Array]:
        """One pour: NaN for what it does not show, and for readings that leave it out."""
        poured = None if self.poured is None else self.poured.at(self.scene)
        own = () if poured is None else (crc32(poured.name.encode()),)
        generator = np.random.default_rng([self.seed, _STREAM, row, *own])
        theta = generator.random(len(self.prior.names))
        unit = generator.random(len(self.conditions))
        values = dict(
            zip(self.prior.names, from_cube(self.prior, theta[None])[0].tolist(), strict=True)
        )
        at = {
            p: low + u * (high - low)
            for u, (p, low, high) in zip(unit, self.conditions, strict=True)
        }
        if self.places:
            # Numbers of definitions are in no place, and drawn there as well.
            at |= self.places[row % len(self.places)]
            unit = np.array([(at[p] - low) / (high - low) for p, low, high in self.conditions])
        numbers = {**self.prior.fixed, **values, **at}
        found = {"theta": theta, "condition": unit}
        if poured is not None:
            psi = float(generator.uniform(-1.0 if poured.is_two_sided else 0.0, 1.0))
            numbers |= poured.numbers(psi)
            if poured.whole:
                # A whole number may lie half a grain beyond full strength.
                psi = float(np.clip(poured.strength(np.array(poured.value(psi))), -1.0, 1.0))
            found["poured"] = np.array(psi)
        scene = self.scene.with_(numbers)
        pour = simulate(scene, seed=int(generator.integers(2**62)))
        measures = Measures.of(scene)
        nothing = np.full(len(measures.names), np.nan)
        is_usable = pour.status not in UNUSABLE

        def measure(faults: dict[str, float]) -> Array:
            try:
                return measures.of_pour(pour, faults) if is_usable else nothing
            except ValueError:
                # Too few grains in view.
                return nothing

        for reading in self.readings:
            key = _key(reading)
            # The seeds of what one effect alone is read with are those of before there were two.
            of = np.random.default_rng([self.seed, _STREAM, row, *own, crc32(key.encode())])
            lows = [-1.0 if effect.is_two_sided else 0.0 for effect in reading]
            psi_ = np.array([of.uniform(low, 1.0) for low in lows])
            share = (1.0, _SHARE, _TWO_SHARE)[len(reading)]
            is_read = not reading or of.random() < share
            faults: dict[str, float] = {}
            for effect, strength in zip(reading, psi_.tolist(), strict=True):
                faults |= effect.faults(strength)
            found[f"psi/{key}"] = psi_
            found[f"x/{key}"] = measure(faults) if is_read else nothing
        return found


def _key(reading: tuple[LibraryEffect, ...]) -> str:
    return "+".join(effect.name for effect in reading)


def _name(chunk: int) -> str:
    return f"rows-{chunk:05d}"
