"""Run-out files: radius of a front against time, as tracked in videos."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.measured.names import observed_of, value_at
from granulcal.scene import Scene
from granulcal.statistics import ObservedStatistics

__all__ = ["RunOut"]

Array = NDArray[np.float64]

# Frame, then fluid radius and velocity, particle radius and velocity of each of two cameras.
_COLUMNS = 9
_PARTICLE_RADII = (3, 7)
_FLUID_RADII = (1, 5)


@dataclass(frozen=True, kw_only=True, eq=False)
class RunOut:
    """The fronts of a collapsing column.

    Files have a line of names and then nine columns: frame, and for each of two cameras the radius
    of the fluid's front [m], its velocity, the radius of the particles' front [m] and its velocity;
    `nan` where it was not tracked. A radius is the average over the azimuths that a camera sees.

    Attributes:
        time: since the release [s], shape (n,).
        particles: radius of the particles' front by camera [m], shape (n, 2).
        fluid: radius of the fluid's front by camera [m], shape (n, 2).
    """

    time: Array
    particles: Array
    fluid: Array

    @classmethod
    def open(cls, path: str | PathLike[str], *, fps: float = 240.0) -> "RunOut":
        """Returns the fronts in a run-out file.

        Args:
            path: the text file.
            fps: frames of the video in a second.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is no run-out file, or fps is not positive; the message says where.
        """
        if not (np.isfinite(fps) and fps > 0.0):
            raise ValueError(f"fps must be positive and finite, got {fps}")
        lines = Path(path).read_text().splitlines()
        rows = []
        for number, line in enumerate(lines[1:], start=2):
            words = line.split()
            if not words:
                continue
            try:
                row = [float(word) for word in words]
            except ValueError:
                raise ValueError(f"{path}: line {number} must be numbers, got {line!r}") from None
            if len(row) != _COLUMNS:
                raise ValueError(
                    f"{path}: line {number} must have {_COLUMNS} numbers, got {len(row)}"
                )
            rows.append(row)
        if not rows:
            raise ValueError(f"{path}: at least one frame is needed, got none")
        table = np.array(rows)
        frames = table[:, 0]
        if not (np.isfinite(frames).all() and (np.diff(frames) > 0).all()):
            raise ValueError(f"{path}: frame numbers must rise")
        return cls(
            time=frames / fps, particles=table[:, _PARTICLE_RADII], fluid=table[:, _FLUID_RADII]
        )

    def front_radius(self) -> Array:
        """Returns the particles' front [m], the mean of the cameras that saw it, shape (n,)."""
        seen = np.isfinite(self.particles)
        total = np.where(seen, self.particles, 0.0).sum(axis=1)
        count = seen.sum(axis=1)
        return np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0)

    def observed(self, scene: Scene) -> ObservedStatistics:
        """Returns the measured `front_radius[t]` of the scene's times; `front_radius[end]` is last.

        Raises:
            ValueError: the scene observes no front.
        """
        radius = self.front_radius()
        last = radius[np.isfinite(radius)]
        end = float(last[-1]) if len(last) else float("nan")

        def front(at: str | None) -> float:
            return end if at == "end" else value_at(self.time, radius, float(at or "nan"))

        return observed_of(scene, {"front_radius": front}, "a run-out file")
