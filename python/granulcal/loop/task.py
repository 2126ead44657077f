"""What the loop is asked: a scene, a prior, and recordings under several conditions.

    scene = "scene.toml"            # paths are relative to this file
    prior = "prior.toml"
    effects = ["drag", "tilt.x"]    # of the library; all of it where this is left out

    [[conditions]]
    name = "4 cm"
    at = { "funnel.height" = 0.04 }
    use = "fit"                     # or "sealed": opened once, after the verdict
    recordings = ["04cm/pour-0.png", "04cm/pour-1.png"]   # a pour each

`camera = "camera.toml"` of a condition, or once for all, is the camera of PNGs; where it is left out it is
looked for beside the recording.
"""

import tomllib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.library import FUNNEL, LibraryEffect, by_name
from granulcal.prior import Prior
from granulcal.recording import Recording
from granulcal.scene import Scene

__all__ = ["FIT", "SEALED", "Condition", "Task", "camera_beside"]

Array = NDArray[np.float64]

FIT, SEALED = "fit", "sealed"
# Fewest pours over all fit conditions from which something may be said.
_FEWEST_POURS = 3
# Volume under the measured surface over that of the scene's grains: beyond this a unit is wrong.
_VOLUME_RANGE = (0.1, 10.0)


@dataclass(frozen=True)
class Condition:
    """Pours of one material under one condition.

    Attributes:
        name: what tables call it.
        at: numbers of the scene by path.
        use: `fit` or `sealed`.
        recordings: a pour each.
        camera: of PNGs.
    """

    name: str
    at: dict[str, float]
    use: str
    recordings: tuple[Path, ...]
    camera: Path | None

    def statistics(self, scene: Scene) -> Array:
        """Returns the 16 and the diagnostic statistics of each pour, shape (n, 56).

        Raises:
            ObservationError: a recording that cannot be one of the scene: its units, most likely.
        """
        there = scene.with_(self.at)
        diameter = there.get("grains.diameter")
        grains = there.get("grains.count") * np.pi / 6 * diameter**3
        rows = []
        for path in self.recordings:
            recording = Recording.open(path, camera=self.camera or camera_beside(path))
            formation = recording.formation(ground_resolution=there.ground_resolution)
            share = formation.volume / grains
            if not _VOLUME_RANGE[0] <= share <= _VOLUME_RANGE[1]:
                raise ObservationError(
                    f"{path}: the formation holds {formation.volume:.3g} m3, the scene's grains "
                    f"{grains:.3g} m3; allowed are {_VOLUME_RANGE[0]:g} to {_VOLUME_RANGE[1]:g} "
                    "times that: is the recording of this scene, and in its units?"
                )
            diagnostics = formation.diagnostic_statistics(
                grain_diameter=diameter, pour_axis=_axis_of(recording, formation)
            )
            rows.append(np.concatenate([formation.statistics(), diagnostics]))
        return np.array(rows)


@dataclass(frozen=True)
class Task:
    """What is asked.

    Attributes:
        scene: the base model.
        prior: of its material.
        conditions: at least one to fit.
        library: effects to look for.
        path: the file that it was read from.
    """

    scene: Scene
    prior: Prior
    conditions: tuple[Condition, ...]
    library: tuple[LibraryEffect, ...]
    path: Path | None = None

    def __post_init__(self) -> None:
        """Checks that the conditions can be asked about.

        Raises:
            ObservationError: too few pours, conditions without the same paths, a name twice.
        """
        names = [condition.name for condition in self.conditions]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ObservationError(f"conditions need names of their own, twice: {repeated}")
        pours = sum(len(c.recordings) for c in self.of(FIT))
        if pours < _FEWEST_POURS:
            raise ObservationError(
                f"a verdict needs at least {_FEWEST_POURS} pours in conditions to fit, got {pours}"
            )
        for condition in self.conditions:
            if set(condition.at) != set(self.paths):
                raise ObservationError(
                    f"{condition.name}: conditions must state the same numbers, "
                    f"{sorted(self.paths)}; got {sorted(condition.at)}"
                )

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "Task":
        """Returns the task in a TOML file.

        Raises:
            FileNotFoundError: a file that it names is not there.
            ObservationError: unknown or missing keys.
        """
        file = Path(path)
        try:
            document = tomllib.loads(file.read_text(encoding="utf-8"))
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ObservationError(f"{file}: not valid TOML: {error}") from None
        _require(file, document, {"scene", "prior", "conditions"}, {"effects", "camera"})
        folder = file.parent
        shared = {"camera": document["camera"]} if "camera" in document else {}
        library = by_name(document["effects"]) if "effects" in document else FUNNEL
        return cls(
            scene=Scene.load(folder / document["scene"]),
            prior=Prior.load(folder / document["prior"]),
            conditions=tuple(
                _condition(file, {**shared, **table}) for table in document["conditions"]
            ),
            library=library,
            path=file,
        )

    def of(self, use: str) -> tuple[Condition, ...]:
        """Returns the conditions of one use."""
        return tuple(condition for condition in self.conditions if condition.use == use)

    @property
    def paths(self) -> tuple[str, ...]:
        """The numbers that the conditions state."""
        return tuple(self.conditions[0].at)

    @property
    def inputs(self) -> tuple[tuple[str, float, float], ...]:
        """Path, least and largest value of each number that differs between conditions."""
        found = []
        for path in self.paths:
            values = [condition.at[path] for condition in self.conditions]
            if min(values) < max(values):
                found.append((path, min(values), max(values)))
        return tuple(found)

    def unit(self, condition: Condition) -> Array:
        """Returns a condition's inputs in [0, 1], shape (q,)."""
        return np.array([(condition.at[p] - low) / (high - low) for p, low, high in self.inputs])

    def at_first(self) -> Scene:
        """Returns the scene with the numbers that all conditions share."""
        differing = {path for path, _, _ in self.inputs}
        shared = {p: v for p, v in self.conditions[0].at.items() if p not in differing}
        return self.scene.with_(shared) if shared else self.scene


def _condition(file: Path, table: dict[str, Any]) -> Condition:
    needed = {"name", "at", "use", "recordings"}
    _require(file, table, needed, {"camera"})
    if table["use"] not in (FIT, SEALED):
        raise ObservationError(
            f'{file}: use of {table["name"]} must be "{FIT}" or "{SEALED}", got "{table["use"]}"'
        )
    recordings = tuple(file.parent / name for name in table["recordings"])
    if not recordings:
        raise ObservationError(f"{file}: {table['name']} has no recordings")
    for recording in recordings:
        if not recording.exists():
            raise FileNotFoundError(f"{recording} of {file} is not there")
    camera = file.parent / table["camera"] if "camera" in table else None
    at = {path: float(value) for path, value in table["at"].items()}
    return Condition(str(table["name"]), at, table["use"], recordings, camera)


def _require(file: Path, table: dict[str, Any], needed: set[str], optional: set[str]) -> None:
    missing, unknown = sorted(needed - set(table)), sorted(set(table) - needed - optional)
    if missing or unknown:
        what = f"lacks {', '.join(missing)}" if missing else f"has unknown {', '.join(unknown)}"
        raise ObservationError(
            f"{file}: a table {what}; it has {', '.join(sorted(needed))} "
            f"and may have {', '.join(sorted(optional))}"
        )


def camera_beside(path: Path) -> Path | None:
    """Returns the camera of a PNG: its own TOML, or `camera.toml` in its folder or the one above."""
    if path.suffix != ".png":
        return None
    near = [
        path.with_suffix(".toml"),
        path.parent / "camera.toml",
        path.parent.parent / "camera.toml",
    ]
    return next((file for file in near if file.exists()), None)


def _axis_of(recording: Recording, formation: Any) -> tuple[float, float] | None:
    """Where the pour's axis meets the ground: below the camera, which stands on it in our scenes."""
    return (0.0, 0.0) if recording.depth is not None else None
