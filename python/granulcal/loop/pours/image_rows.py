"""Base pours whose image is read again under every effect of the image: one pour serves them all.

They are pours of the plain model as well and count among them. In the archive's folder `images/`:
chunks of pours, each with its parameters, its statistics, and the strength and statistics under
each effect. A chunk is whole or absent, and is made again where an effect has been added.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import BadZipFile
from zlib import crc32
from zlib import error as zlib_error

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import read_bytes
from granulcal.files import beside
from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.forward import UNUSABLE
from granulcal.loop.pours.measures import Measures
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior

__all__ = ["ImageRows"]

Array = NDArray[np.float64]

_CHUNK = 16
# Of the random numbers, apart from those of every other part.
_STREAM = 5
# Share of the pours that each effect reads again: copies of a pour share its noise, and a surrogate
# that took many for pours of their own would be too sure of itself.
_SHARE = 0.5


@dataclass(frozen=True)
class ImageRows:
    """Pours read under effects of the image.

    Attributes:
        folder: of the chunks.
        scene: the base scene.
        prior: of the material.
        conditions: path and range of each condition input, q of them.
        places: numbers of each condition, where pours are at these alone; else empty.
        effects: of the image.
        count: pours.
        seed: of all of them.
    """

    folder: Path
    scene: Scene
    prior: Prior
    conditions: tuple[tuple[str, float, float], ...]
    places: tuple[dict[str, float], ...]
    effects: tuple[LibraryEffect, ...]
    count: int
    seed: int

    def fill(self, *, threads: int, say: Callable[[str], None] = print) -> None:
        """Pours what is missing."""
        missing = [i for i in range(self._chunks) if self._read(i) is None]
        if missing:
            say(f"images: {len(missing) * _CHUNK} pours, read under {len(self.effects)} effects")
        self.folder.mkdir(parents=True, exist_ok=True)
        with ThreadPoolExecutor(threads) as pool:
            for chunk in missing:
                rows = range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, self.count))
                self._write(chunk, list(pool.map(self._row, rows)))

    def rows(self) -> dict[str, tuple[Array, Array, Array, Array]] | None:
        """Returns theta, condition, strength (n,) and statistics of the usable pours.

        Plain ones under the name "", those under an effect under its name; None if pours are
        missing.
        """
        parts: dict[str, list[tuple[Array, ...]]] = {"": []}
        for chunk in range(self._chunks):
            found = self._read(chunk)
            if found is None:
                return None
            for name in ("", *(effect.name for effect in self.effects)):
                x, psi = found[f"x/{name}"], found[f"psi/{name}"]
                kept = np.isfinite(x).all(axis=1)
                part = found["theta"][kept], found["condition"][kept], psi[kept], x[kept]
                parts.setdefault(name, []).append(part)
        joined: dict[str, tuple[Array, Array, Array, Array]] = {}
        for name, chunks in parts.items():
            theta, condition, psi, x = (np.concatenate(c) for c in zip(*chunks, strict=True))
            joined[name] = theta, condition, psi, x
        return joined

    @property
    def _chunks(self) -> int:
        return -(-self.count // _CHUNK)

    def _path(self, chunk: int) -> Path:
        return self.folder / f"rows-{chunk:05d}.npz"

    def _read(self, chunk: int) -> dict[str, Array] | None:
        path = self._path(chunk)
        if not path.exists():
            return None
        try:
            # In memory: a reader that stumbles leaves a file open.
            with np.load(BytesIO(read_bytes(path))) as file:
                found = {name: file[name] for name in file.files}
        except (ValueError, KeyError, EOFError, OSError, BadZipFile, zlib_error):
            # Damaged: its pours can be made again.
            return None
        wanted = min((chunk + 1) * _CHUNK, self.count) - chunk * _CHUNK
        is_whole = all(f"x/{effect.name}" in found for effect in self.effects)
        return (
            {k: v[:wanted] for k, v in found.items()}
            if is_whole and len(found["theta"]) >= wanted
            else None
        )

    def _write(self, chunk: int, rows: list[dict[str, Array]]) -> None:
        path = self._path(chunk)
        columns: dict[str, Any] = {k: np.array([row[k] for row in rows]) for k in rows[0]}
        with beside(path) as temporary:
            np.savez_compressed(temporary, **columns)

    def _row(self, row: int) -> dict[str, Array]:
        """One pour: NaN for what it does not show, and under effects that leave it out."""
        generator = np.random.default_rng([self.seed, _STREAM, row])
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
            at = self.places[row % len(self.places)]
            unit = np.array([(at[p] - low) / (high - low) for p, low, high in self.conditions])
        scene = self.scene.with_({**self.prior.fixed, **values, **at})
        pour = simulate(scene, seed=int(generator.integers(2**62)))
        measures = Measures.of(scene)
        nothing = np.full(len(measures.names), np.nan)
        is_usable = pour.status not in UNUSABLE

        def look(faults: dict[str, float]) -> Array:
            try:
                return measures.of_pour(pour, faults) if is_usable else nothing
            except ValueError:
                # Too few grains in view.
                return nothing

        found = {"theta": theta, "condition": unit, "psi/": np.array(0.0), "x/": look({})}
        for effect in self.effects:
            own = np.random.default_rng([self.seed, _STREAM, row, crc32(effect.name.encode())])
            psi = own.uniform(-1.0 if effect.is_two_sided else 0.0, 1.0)
            is_read = own.random() < _SHARE
            found[f"psi/{effect.name}"] = np.array(psi)
            found[f"x/{effect.name}"] = look(effect.faults(psi)) if is_read else nothing
        return found
