"""Run-out files: radius of a front against time, as tracked in videos."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import ENCODING
from granulcal.measured.names import observed_of, value_at
from granulcal.measured.table import number_in
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import ObservedStatistics

__all__ = ["RunOut"]

Array = NDArray[np.float64]

# Frame, then fluid radius and velocity, particle radius and velocity of each of two cameras.
_COLUMNS = 9
_PARTICLE_RADII = (3, 7)
_LIQUID_RADII = (1, 5)
# No front is farther out than this [m]: it is one in millimetres.
_FARTHEST = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class RunOut:
    """The fronts of a collapsing column.

    Files have a line of names and then nine columns: frame, and for each of two cameras the radius
    of the liquid's front [m], its velocity, the radius of the particles' front [m] and its
    velocity; `nan` where it was not tracked. A radius is the average over the azimuths that a
    camera sees.

    The two cameras see other azimuths, and differ by up to some beads. So each is read by itself,
    and what counts is the mean over what both see: a mean over the cameras that still see the front
    jumps where one of them stops. A file in which one camera saw nothing is that of the other.

    Attributes:
        time: since the release [s], shape (n,).
        particles: radius of the particles' front by camera [m], shape (n, 2).
        liquid: radius of the liquid's front by camera [m], shape (n, 2).
        source: the file, for messages.
    """

    time: Array
    particles: Array
    liquid: Array
    source: str = "a run-out file"

    @classmethod
    def open(cls, path: str | PathLike[str], *, fps: float = 240.0) -> "RunOut":
        """Returns the fronts in a run-out file.

        Args:
            path: the text file.
            fps: frames of the video in a second.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: it is no run-out file, has radii below 0 or above 10 m, or fps is not
                positive; the message says where.
        """
        if not (np.isfinite(fps) and fps > 0.0):
            raise ValueError(f"fps must be positive and finite, got {fps}")
        # The names are for people, whatever letters they have.
        lines = Path(path).read_text(ENCODING, errors="replace").splitlines()
        if lines and _is_frame(lines[0]):
            raise ValueError(f"{path}: line 1 must be names, got the numbers of a frame")
        rows = []
        for number, line in enumerate(lines[1:], start=2):
            words = line.split()
            if not words:
                continue
            try:
                row = [number_in(word) for word in words]
            except ValueError:
                raise ValueError(f"{path}: line {number} must be numbers, got {line!r}") from None
            if len(row) != _COLUMNS:
                raise ValueError(
                    f"{path}: line {number} must have {_COLUMNS} numbers, got {len(row)}"
                )
            for radius in (row[column] for column in (*_LIQUID_RADII, *_PARTICLE_RADII)):
                if np.isfinite(radius) and not 0.0 <= radius <= _FARTHEST:
                    raise ValueError(
                        f"{path}: line {number}: a front's radius must be from 0 to "
                        f"{_FARTHEST:g} m, got {radius:g}: is it in metres?"
                    )
            rows.append(row)
        if not rows:
            raise ValueError(f"{path}: at least one frame is needed, got none")
        table = np.array(rows)
        frames = table[:, 0]
        if not (np.isfinite(frames).all() and (np.diff(frames) > 0).all()):
            raise ValueError(f"{path}: frame numbers must rise")
        return cls(
            time=frames / fps,
            particles=table[:, _PARTICLE_RADII],
            liquid=table[:, _LIQUID_RADII],
            source=str(path),
        )

    def front_radius(self) -> Array:
        """Returns the particles' front [m], the mean of both cameras, shape (n,).

        NaN where one of them does not see it, unless it never does.
        """
        return _mean(self.particles)

    def liquid_radius(self) -> Array:
        """Returns the liquid's front [m], as `front_radius` has that of the particles, (n,)."""
        return _mean(self.liquid)

    def end_radius(self) -> float:
        """Returns the mean of what each camera saw last of the particles' front [m], or NaN."""
        return _end(self.particles)

    def disagreement(self) -> float:
        """Returns the largest difference of the cameras' particle fronts [m].

        NaN where there is no frame that both see.
        """
        both = np.isfinite(self.particles).all(axis=1)
        gap = np.abs(self.particles[both, 0] - self.particles[both, 1])
        return float(gap.max()) if len(gap) else float("nan")

    def observed(self, scene: Scene, *, camera: int | None = None) -> ObservedStatistics:
        """Returns the measured `front_radius[t]` of the scene's times; `front_radius[end]` is last.

        The end is the mean of what each camera saw last. `liquid_radius[t]` are those of the
        liquid.

        Args:
            scene: the scene whose statistics are asked for.
            camera: 1 or 2 for what it alone saw; None for the mean of both.

        Raises:
            ValueError: the scene observes no front, the file has none of its particles, or there is
                no such camera.

        Warns:
            UserWarning: the cameras differ by more than a grain.
        """
        if camera not in (None, 1, 2):
            raise ValueError(f"{self.source}: camera must be 1 or 2, got {camera}")
        chosen = slice(None) if camera is None else slice(camera - 1, camera)

        def reader(fronts: Array) -> Callable[[str | None], float]:
            radius, end = _mean(fronts), _end(fronts)

            def front(at: str | None) -> float:
                return end if at == "end" else value_at(self.time, radius, float(at or "nan"))

            return front

        found = observed_of(
            scene,
            {
                "front_radius": reader(self.particles[:, chosen]),
                "liquid_radius": reader(self.liquid[:, chosen]),
            },
            "a run-out file",
        )
        if not np.isfinite(self.particles[:, chosen]).any():
            where = "" if camera is None else f" by camera {camera}"
            raise ValueError(f"{self.source}: no front of particles was tracked{where}")
        diameter, gap = scene.get("grains.diameter"), self.disagreement()
        if camera is None and gap > diameter:
            warnings.warn(
                f"{self.source}: the cameras' fronts differ by up to {1e3 * gap:.0f} mm, more than "
                f"a grain of {1e3 * diameter:.3g} mm; camera=1 and camera=2 read each by itself",
                stacklevel=2,
            )
        return found


def _is_frame(line: str) -> bool:
    """Whether a line is numbers, as many as a frame has."""
    words = line.split()
    try:
        return len([number_in(word) for word in words]) == _COLUMNS
    except ValueError:
        return False


def _mean(fronts: Array) -> Array:
    """Mean over the cameras that ever see a front (n, c), where all of them do, shape (n,)."""
    seeing = np.isfinite(fronts).any(axis=0)
    if not seeing.any():
        return np.full(len(fronts), np.nan)
    return np.asarray(fronts[:, seeing].mean(axis=1), dtype=np.float64)


def _end(fronts: Array) -> float:
    """Mean of the last values that the cameras of (n, c) saw; NaN without any."""
    last = [front[np.isfinite(front)][-1] for front in fronts.T if np.isfinite(front).any()]
    return float(np.mean(last)) if last else float("nan")
