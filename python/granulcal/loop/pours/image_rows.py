"""Base pours whose image is read again under every effect of the image: one pour serves them all.

They are pours of the plain model as well and count among them. In the archive's folder `images/`:
chunks of pours, each with its parameters, its statistics, and the strength and statistics under
each effect. A chunk is whole or absent, and is made again where an effect has been added.
"""

from collections.abc import Callable
from dataclasses import dataclass
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
        store = PourStore(self.folder, threads)
        for chunk in missing:
            of = range(chunk * _CHUNK, min((chunk + 1) * _CHUNK, self.count))
            rows = store.make(self._row, of)
            store.keep(_name(chunk), {k: np.array([row[k] for row in rows]) for k in rows[0]})

    def rows(self) -> dict[str, Rows] | None:
        """Returns the usable pours, with the strength of one effect as the only psi.

        Plain ones under the name "", those under an effect under its name; None if pours are
        missing.
        """
        parts: dict[str, list[Rows]] = {"": []}
        for chunk in range(self._chunks):
            found = self._read(chunk)
            if found is None:
                return None
            for name in ("", *(effect.name for effect in self.effects)):
                x, psi = found[f"x/{name}"], found[f"psi/{name}"][:, None]
                rows = Rows(found["theta"], found["condition"], psi, x)
                parts.setdefault(name, []).append(rows.taken(np.all(np.isfinite(x), axis=1)))
        return {name: Rows.joined(chunks) for name, chunks in parts.items()}

    @property
    def _chunks(self) -> int:
        return -(-self.count // _CHUNK)

    def _read(self, chunk: int) -> dict[str, Array] | None:
        found = PourStore(self.folder).read(_name(chunk))
        if found is None or "theta" not in found:
            return None
        wanted = min((chunk + 1) * _CHUNK, self.count) - chunk * _CHUNK
        is_whole = all(f"x/{effect.name}" in found for effect in self.effects)
        return (
            {k: v[:wanted] for k, v in found.items()}
            if is_whole and len(found["theta"]) >= wanted
            else None
        )

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

        def measure(faults: dict[str, float]) -> Array:
            try:
                return measures.of_pour(pour, faults) if is_usable else nothing
            except ValueError:
                # Too few grains in view.
                return nothing

        found = {"theta": theta, "condition": unit, "psi/": np.array(0.0), "x/": measure({})}
        for effect in self.effects:
            own = np.random.default_rng([self.seed, _STREAM, row, crc32(effect.name.encode())])
            psi = own.uniform(-1.0 if effect.is_two_sided else 0.0, 1.0)
            is_read = own.random() < _SHARE
            found[f"psi/{effect.name}"] = np.array(psi)
            found[f"x/{effect.name}"] = measure(effect.faults(psi)) if is_read else nothing
        return found


def _name(chunk: int) -> str:
    return f"rows-{chunk:05d}"
