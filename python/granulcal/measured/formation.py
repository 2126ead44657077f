"""What is found in a recording: the plane of its ground, levelled points, the formation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.pours.statistics import (
    DiagnosticStatistics,
    Statistics,
    diagnostic_statistics,
    statistics,
)

__all__ = ["EdgePixelsWarning", "Formation", "Levelled", "Plane", "plane_of"]

Array = NDArray[np.float64]


class EdgePixelsWarning(UserWarning):
    """Pixels at the edge of a height map, apart from the formation, are taken for grains."""


@dataclass(frozen=True, kw_only=True)
class Plane:
    """The ground that was fitted, in the frame of the camera or of the height map.

    Attributes:
        normal: unit normal towards the grains.
        offset: normal . point for points of the plane [m].
        tilt_deg: angle between the normal and the vertical of the frame [deg].
        rms: root mean square distance of the inliers [m].
        inlier_count: pixels that decided.
    """

    normal: tuple[float, float, float]
    offset: float
    tilt_deg: float
    rms: float
    inlier_count: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Levelled:
    """An image whose ground was found, whether or not there is a grain on it.

    Attributes:
        heights: heights of all pixels above the fitted ground [m], NaN is no data, shape (h, w)
            after down-sampling.
        mask: which pixels are grain, shape (h, w); none on a flat bed.
        plane: the fitted ground.
        ground_sd: robust standard deviation of the ground about its plane [m].
        threshold: height from which a pixel counts as grain [m].
        valid_count: pixels that carry data.
        downsample: factor by which the image was down-sampled.
        resolution: width of a pixel on the ground along x and y [m].
    """

    heights: Array
    mask: NDArray[np.bool_]
    plane: Plane
    ground_sd: float
    threshold: float
    valid_count: int
    downsample: int
    resolution: tuple[float, float]

    def __repr__(self) -> str:
        rows, columns = self.mask.shape
        shares = f"{self.mask.sum()} of {self.valid_count} with data"
        found = f"above {1e3 * self.threshold:.3g} mm; tilt {self.plane.tilt_deg:.2f} deg"
        return f"Levelled({columns} x {rows} pixels, {shares} are grain, {found})"


@dataclass(frozen=True, kw_only=True, eq=False)
class Formation:
    """The points of a formation and how they were found.

    Attributes:
        points: points of the grains [m], ground at z = 0, centroid at x = y = 0, shape (n, 3).
        mask: which pixels they are, shape (h, w) after down-sampling.
        heights: heights of all pixels above the fitted ground [m], NaN is no data, shape (h, w).
        plane: the fitted ground.
        ground_sd: robust standard deviation of the ground about its plane [m].
        valid_count: pixels that carry data.
        threshold: height from which a pixel counts as grain [m].
        centroid: where the centroid was before it was moved to 0 [m].
        volume: volume between the ground and the surface of the grains' pixels [m^3].
        kind: "pile", or "ring" when the middle is lower than the rim around it.
        half_volume_radius: radius about the volume's centroid that holds half of it [m].
        profile: mean heights within half of that radius and around it [m], which decide the kind.
        downsample: factor by which the image was down-sampled.
        resolution: width of a pixel on the ground along x and y [m].
        spacing: side of a pixel on the ground [m], the root of its area.
    """

    points: Array
    mask: NDArray[np.bool_]
    heights: Array
    plane: Plane
    ground_sd: float
    valid_count: int
    threshold: float
    centroid: tuple[float, float]
    volume: float
    kind: str
    half_volume_radius: float
    profile: tuple[float, float]
    downsample: int
    resolution: tuple[float, float]
    spacing: float

    def __repr__(self) -> str:
        return (
            f"Formation({self.kind}, {len(self.points)} of {self.valid_count} pixels with data, "
            f"{1e6 * self.volume:.3g} cm3, half of it within {1e3 * self.half_volume_radius:.3g} "
            f"mm; tilt {self.plane.tilt_deg:.2f} deg)"
        )

    def statistics(self) -> Statistics:
        """Returns the statistics of the points."""
        return statistics(self.points)

    def diagnostic_statistics(
        self, *, grain_diameter: float, pour_axis: tuple[float, float] | None = None
    ) -> DiagnosticStatistics:
        """Returns the diagnostic statistics of the points.

        Args:
            grain_diameter: diameter of a grain [m].
            pour_axis: where the axis of the pour meets the levelled ground [m], in the frame in
                which `centroid` is told; the centroid if None, which hides modes of order 1.

        Raises:
            ValueError: fewer than 3 points, or a length out of range.
        """
        axis = None
        if pour_axis is not None:
            axis = (pour_axis[0] - self.centroid[0], pour_axis[1] - self.centroid[1])
        return diagnostic_statistics(
            self.points, grain_diameter=grain_diameter, spacing=self.spacing, pour_axis=axis
        )

    def height_image(self) -> Array:
        """Returns heights above the fitted ground [m], NaN where no grain is, shape (h, w)."""
        image = np.full(self.mask.shape, np.nan)
        image[self.mask] = self.points[:, 2]
        return image


def plane_of(parts: tuple[tuple[float, float, float], float, float, float, int]) -> Plane:
    """Returns the plane of its parts, as the native module gives them."""
    normal, offset, tilt_rad, rms, inliers = parts
    return Plane(
        normal=normal,
        offset=offset,
        tilt_deg=float(np.degrees(tilt_rad)),
        rms=rms,
        inlier_count=inliers,
    )
