"""What a ring looks like: its profile, the depth of the crater, the rim."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.measured.recording import Recording
from granulcal.pours.simulate import Pour

__all__ = ["Shape", "measured", "profile", "simulated"]

Array = NDArray[np.float64]

# Width of a ring of the profile, and how far it goes [m].
_RING, _FAR = 6e-3, 0.15
# Radius of the ball that falls [m].
_BALL = 0.03
# Heights of less are the bed's noise [m].
_THRESHOLD = 1e-3


@dataclass(frozen=True)
class Shape:
    """A ring in three numbers, of its mean over the azimuth.

    Attributes:
        depth: of the lowest point within the rim, below the bed [m].
        rim: height of the rim [m].
        radius: of the rim [m].
    """

    depth: float
    rim: float
    radius: float

    @classmethod
    def of(cls, radii: Array, heights: Array) -> "Shape":
        """Returns the shape of a profile: its rim is the highest point beyond the ball's radius.

        What lies in the middle is debris. Of a heap the rim is at the ball's radius.
        """
        beyond = int(np.searchsorted(radii, _BALL))
        high = beyond + int(np.argmax(heights[beyond:]))
        depth = max(-float(heights[: high + 1].min()), 0.0)
        return cls(depth, float(heights[high]), float(radii[high]))


def profile(heights: Array, spacing: float) -> tuple[Array, Array]:
    """Returns radii and mean heights in rings about the middle of what stands above the bed [m].

    Args:
        heights: over the bed, NaN is no data, shape (h, w) [m].
        spacing: of pixels [m].
    """
    rows, columns = np.nonzero(np.nan_to_num(heights) > _THRESHOLD)
    y, x = (
        spacing * (np.arange(size) - float(np.median(middle)))
        for size, middle in zip(heights.shape, (rows, columns), strict=True)
    )
    radius = np.hypot(y[:, None], x[None])
    edges = np.arange(0.0, _FAR + 0.5 * _RING, _RING)
    ring = np.digitize(radius.ravel(), edges) - 1
    flat = heights.ravel()
    known = np.isfinite(flat) & (ring < len(edges) - 1)
    count = np.bincount(ring[known], minlength=len(edges) - 1)
    total = np.bincount(ring[known], flat[known], minlength=len(edges) - 1)
    return edges[:-1] + 0.5 * _RING, total / np.maximum(count, 1)


def measured(path: Path, reading: dict[str, Any]) -> tuple[Array, float]:
    """Returns heights of a map over its bed [m], (h, w), and the spacing of its pixels [m]."""
    level = Recording.open(path).level(**reading)
    return np.asarray(level.heights, dtype=np.float64), float(level.resolution[0])


def simulated(pour: Pour) -> tuple[Array, float]:
    """Returns the same of a pour."""
    return pour.height_map(), float(pour.scene.ground_resolution)
