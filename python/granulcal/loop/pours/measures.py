"""What the loop compares: the image's statistics, or those that a scene itself observes."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.errors import ObservationError
from granulcal.loop.effects.image_faults import Frame
from granulcal.loop.effects.series_faults import reread
from granulcal.measured.recording import Formation, Recording
from granulcal.pours.dataset import Dataset
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour
from granulcal.pours.statistics import (
    DIAGNOSTIC_NAMES,
    NAMES,
    REGISTRY,
    diagnostic_statistics,
    statistics,
)

__all__ = ["Measures", "camera_used", "formation_of", "is_above_axis"]

Array = NDArray[np.float64]

# Of the diagnostics: a slope that few formations have, rings of which the 16 statistics hold the
# sum (twenty more numbers to a pour blunt every test of the others), and patches, which repeat
# isolated grains and clusters.
_LEFT_OUT = ("tail_index", "height_ring", "patches")
# Where the pour is beside its axis: a height map does not know where the axis was.
_OF_AXIS = ("mass_cos_1", "mass_sin_1", "rim_cos_1", "rim_sin_1")
# Volume under the measured surface over that of the scene's grains: beyond this a unit is wrong.
_VOLUME_RANGE = (0.1, 10.0)


@dataclass(frozen=True)
class Measures:
    """Statistics of a kind of scene.

    Attributes:
        names: of the statistics, s of them.
        powers: of lengths in each, shape (s,); None where a scale is no effect of the camera.
        head: the first so many are the error's: the paper's 16, or all.
        observes: whether the scene observes them itself.
    """

    names: tuple[str, ...]
    powers: Array | None
    head: int
    observes: bool

    @classmethod
    def of(cls, scene: Scene) -> "Measures":
        """Returns the statistics of a scene."""
        if scene.observed_names:
            names = tuple(scene.observed_names)
            return cls(names, None, len(names), True)
        left_out = _LEFT_OUT if is_above_axis(scene) else (*_LEFT_OUT, *_OF_AXIS)
        kept = [name for name in DIAGNOSTIC_NAMES if not name.startswith(left_out)]
        names = (*NAMES, *kept)
        power = {s.name: s.length_power for s in REGISTRY}
        return cls(names, np.array([power[name] for name in names]), len(NAMES), False)

    def of_dataset(self, data: Dataset) -> tuple[Array, NDArray[np.bool_]]:
        """Returns the statistics of all rows (n, s), and which rows are usable."""
        columns = data.columns()
        values = np.column_stack([columns[name] for name in self.names])
        return values, data.is_usable & np.isfinite(values).all(axis=1)

    def of_pour(self, pour: Pour, faults: Mapping[str, float] | None = None) -> Array:
        """Returns the statistics of a pour, shape (s,).

        `faults` are those of the image, or of what is observed, by kind:
        `image_faults.py`, `series_faults.py`.

        Raises:
            ValueError: too few grains are in view.
        """
        if self.observes:
            plain = np.asarray(pour.observed())
            return reread(self.names, plain[None], faults)[0] if faults else plain
        if faults:
            frame = Frame.with_faults(pour, faults, pour.seed)
            points, spacing = frame.points(), frame.spacing
            found = diagnostic_statistics(
                points, grain_diameter=frame.diameter, spacing=spacing, pour_axis=(0.0, 0.0)
            )
            both = {**statistics(points).to_dict(), **found.to_dict()}
        else:
            both = {**pour.statistics().to_dict(), **pour.diagnostic_statistics().to_dict()}
        return np.array([both[name] for name in self.names])

    def of_recording(
        self,
        path: Path,
        scene: Scene,
        camera: Path | None,
        reading: Mapping[str, Any] | None = None,
    ) -> Array:
        """Returns the statistics of a recording, shape (s,); NaN for what it does not show.

        `reading` are arguments of `Recording.observed` or `Recording.formation`.

        Raises:
            ObservationError: a recording that cannot be one of the scene: its units, most likely.
        """
        if self.observes:
            return np.asarray(Recording.observed(path, scene, **(reading or {})))
        recording, formation = formation_of(path, scene, camera, reading)
        diameter = scene.get("grains.diameter")
        grains = scene.get("grains.count") * np.pi / 6 * diameter**3
        if not _VOLUME_RANGE[0] <= formation.volume / grains <= _VOLUME_RANGE[1]:
            raise ObservationError(
                f"{path}: the formation holds {formation.volume:.3g} m3, the scene's grains "
                f"{grains:.3g} m3; allowed are {_VOLUME_RANGE[0]:g} to {_VOLUME_RANGE[1]:g} "
                "times that: is the recording of this scene, and in its units?"
            )
        is_map = recording.depth is None
        if is_map and is_above_axis(scene):
            raise ObservationError(
                f"{path} is a height map, which does not say where the pour's axis was; the "
                "scene's pinhole camera stands on it: give depth images, or a scene with "
                'camera.projection = "orthographic"'
            )
        # What of a camera beside the axis: the effects camera.x and camera.y.
        axis = None if is_map else (0.0, 0.0)
        found = formation.diagnostic_statistics(grain_diameter=diameter, pour_axis=axis)
        both = {**formation.statistics().to_dict(), **found.to_dict()}
        return np.array([both[name] for name in self.names])


def is_above_axis(scene: Scene) -> bool:
    """Whether recordings are of a camera above the pour's axis, and not maps of any origin."""
    return scene.to_dict()["camera"]["projection"] == "pinhole"


def formation_of(
    path: Path, scene: Scene, camera: Path | None, reading: Mapping[str, Any] | None = None
) -> tuple[Recording, Formation]:
    """Returns a recording and its formation, its pixels as wide as those of the scene's images."""
    recording = Recording.open(path, camera=camera_used(path, camera))
    settings = {**scene.reading, **(reading or {})}
    return recording, recording.formation(**settings)


def camera_used(path: Path, given: Path | None) -> Path | None:
    """Returns the TOML of the camera by which a recording is read; None for its own."""
    beside = None if given else _native.camera_beside(path)
    return given or (Path(beside) if beside else None)
