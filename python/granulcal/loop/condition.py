"""One condition of a task: numbers of the scene, recordings, and how they are read."""

import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.effects.definitions import Definition
from granulcal.loop.pours.measures import Measures
from granulcal.pours.scene import Scene

__all__ = [
    "FIT",
    "SEALED",
    "Condition",
    "by_each",
    "condition_of",
    "digest_of",
    "require_different",
]

Array = NDArray[np.float64]

FIT, SEALED = "fit", "sealed"
"""What a condition is for: its pours are fitted, or opened once, after the verdict."""


@dataclass(frozen=True)
class Condition:
    """Pours of one material under one condition.

    Attributes:
        name: what tables call it.
        at: numbers of the scene by path.
        use: `fit` or `sealed`.
        recordings: a pour each.
        camera: of PNGs.
        known: numbers that an effect has here, should it be the one, for example
            `{"effects.fluid.density": 1260.0}`.
        reading: arguments with which the recordings are read.
        averaged: each recording is a mean over time of what a pour shows, at least as steady as the
            simulated mean of one pour; it is taken to be as noisy as that.
        session: when it was recorded: what each condition has of its own, such as a clock, is the
            same in all of one session; empty for one of its own.
    """

    name: str
    at: dict[str, float]
    use: str
    recordings: tuple[Path, ...]
    camera: Path | None = None
    known: dict[str, float] = field(default_factory=dict)
    reading: dict[str, Any] = field(default_factory=dict)
    averaged: bool = False
    session: str = ""

    def under(self, definition: Definition) -> "Condition":
        """Returns the condition by a definition."""
        return replace(
            self,
            at={**self.at, **definition.at},
            reading={**self.reading, **definition.reading},
        )

    def statistics(self, scene: Scene) -> Array:
        """Returns the statistics of each pour, shape (n, s).

        Raises:
            ObservationError: a recording that cannot be one of the scene, or that does not show all
                that the scene observes.
        """
        there = scene.with_(self.at)
        measures = Measures.of(there)
        rows = np.array([self._read(measures, path, there) for path in self.recordings])
        for path, row in zip(self.recordings, rows, strict=True):
            unseen = [n for n, v in zip(measures.names, row, strict=True) if not np.isfinite(v)]
            if unseen:
                raise ObservationError(
                    f"{path} does not show {', '.join(unseen)}, which the scene observes: let the "
                    "scene observe what every recording shows, or leave this one out"
                )
        return rows

    def _read(self, measures: Measures, path: Path, there: Scene) -> Array:
        try:
            return measures.of_recording(path, there, self.camera, self.reading)
        except (TypeError, OverflowError) as error:
            raise ObservationError(f"{path} cannot be read with {self.reading}: {error}") from None


def condition_of(file: Path, table: dict[str, Any]) -> Condition:
    """Returns the condition of a table of a task's `file`; its recordings must be there."""
    recordings = tuple(file.parent / name for name in table["recordings"])
    for recording in recordings:
        if not recording.exists():
            raise FileNotFoundError(f"{recording} of {file} is not there")
    camera = file.parent / table["camera"] if "camera" in table else None
    if camera is not None and not camera.exists():
        raise FileNotFoundError(f"{camera} of {file}, the camera of {table['name']}, is not there")
    at = {path: float(value) for path, value in table["at"].items()}
    known = {path: float(value) for path, value in table.get("known", {}).items()}
    return Condition(
        str(table["name"]),
        at,
        table["use"],
        recordings,
        camera,
        known,
        reading=dict(table.get("reading", {})),
        averaged=table.get("averaged", False),
        session=table.get("session", ""),
    )


def digest_of(recording: Path) -> str:
    """Returns the SHA-256 of a recording's file, or of all files of its folder."""
    is_folder = recording.is_dir()
    files = sorted(p for p in recording.rglob("*") if p.is_file()) if is_folder else [recording]
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def require_different(conditions: tuple[Condition, ...]) -> None:
    """Refuses a recording that is given twice: it would count as two pours."""
    seen: dict[Path, str] = {}
    for condition in conditions:
        for path in condition.recordings:
            there = path.resolve()
            if there in seen:
                raise ObservationError(
                    f"{path} is a recording of {seen[there]!r} and again of {condition.name!r}: "
                    "each pour counts once"
                )
            seen[there] = condition.name


def by_each(
    conditions: tuple[Condition, ...], definitions: tuple[Definition, ...]
) -> tuple[Condition, ...]:
    """Returns conditions by every definition; themselves where there is none."""
    return tuple(c.under(one) for one in definitions for c in conditions) or conditions
