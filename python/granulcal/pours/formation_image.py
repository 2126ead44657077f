"""Formations as pictures: heights of grain points on one common grid."""

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "common_field",
    "formation_figure",
    "height_grid",
    "neighbour_distances",
    "point_spacing",
]

Array = NDArray[np.float64]

_PIXELS = 240
_MM = 1e3
# Points whose nearest neighbours set the size of a point's patch.
_SPACING_SAMPLE = 400
# Widest patch of a point, in widths of a pixel: grains that lie alone are farther apart.
_WIDEST = 1.5


def common_field(clouds: Sequence[Array], *, share: float = 0.97, sides: float = 2.4) -> float:
    """Returns the side of the square about the origin that shows the formations [m].

    It leaves out the few grains that rolled far away.

    Args:
        clouds: points [m], each of shape (n, 3), centred.
        share: of each formation's coordinates that are in it.
        sides: side over the farthest of these; grains that all lie at the origin have a side, too.
    """
    reach = [float(np.quantile(np.abs(points[:, :2]), share)) for points in clouds if len(points)]
    return sides * (max(reach, default=0.0) or 0.1)


def height_grid(
    points: Array, *, field: float, pixels: int = _PIXELS, patch: float | None = None
) -> Array:
    """Returns the highest point of each cell of a square grid [m], NaN where none is.

    Each point fills a patch as wide as the distance between neighbouring points, so clouds of
    different resolution look alike, unless its width is given: of clouds of one camera, in some of
    which grains lie alone.

    Args:
        points: points [m], shape (n, 3), centred.
        field: side of the square [m].
        pixels: cells along a side.
        patch: width of a point [m].
    """
    grid = np.full((pixels, pixels), -np.inf)
    if len(points):
        cell = field / pixels
        width = int(np.ceil((patch or point_spacing(points)) / cell)) + 1
        corner = np.floor((points[:, :2] + field / 2) / cell - (width - 1) / 2).astype(int)
        for right in range(width):
            for up in range(width):
                columns, rows = corner[:, 0] + right, corner[:, 1] + up
                inside = (columns >= 0) & (columns < pixels) & (rows >= 0) & (rows < pixels)
                np.maximum.at(grid, (rows[inside], columns[inside]), points[inside, 2])
    return np.where(np.isfinite(grid), grid, np.nan)


def formation_figure(clouds: dict[str, Array], *, resolution: float) -> bytes:
    """Returns a PNG of the formations side by side: one field, one colour scale in mm.

    Args:
        clouds: points [m] by title, each of shape (n, 3), centred.
        resolution: width of a pixel on the ground [m]: `Scene.ground_resolution`.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    field = common_field(list(clouds.values()))
    grids = []
    for points in clouds.values():
        patch = min(point_spacing(points), _WIDEST * resolution) if len(points) > 1 else resolution
        grids.append(_MM * height_grid(points, field=field, patch=patch))
    tallest = max((float(np.nanmax(g)) for g in grids if np.isfinite(g).any()), default=1.0)
    figure = Figure(figsize=(3.6 * len(clouds) + 0.8, 3.7), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(1, len(clouds), sharey=True))
    half = _MM * field / 2
    image: Any = None
    for axis, grid, title in zip(axes, grids, clouds, strict=True):
        axis.set_facecolor("#20262b")
        image = axis.imshow(
            grid,
            origin="lower",
            extent=(-half, half, -half, half),
            cmap="viridis",
            vmin=0,
            vmax=tallest,
            interpolation="nearest",
        )
        axis.set_title(title, fontsize=11)
        axis.set_xlabel("x [mm]")
    axes[0].set_ylabel("y [mm]")
    figure.colorbar(image, ax=list(axes), label="height above the ground [mm]", shrink=0.9)
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=130, bbox_inches="tight")
    return buffer.getvalue()


def point_spacing(points: Array) -> float:
    """Returns the median distance between neighbouring points in the horizontal plane [m].

    Args:
        points: points [m], shape (n, 3), at least one.
    """
    return float(np.median(neighbour_distances(points)))


def neighbour_distances(points: Array) -> Array:
    """Returns the horizontal distance to the nearest point [m] of some hundred points.

    Args:
        points: points [m], shape (n, 3), at least one.
    """
    some = points[:: max(1, len(points) // _SPACING_SAMPLE), :2]
    nearest = np.empty(len(some))
    for i, point in enumerate(some):
        squares = np.sum((points[:, :2] - point) ** 2, axis=1)
        # The smallest is the point itself.
        nearest[i] = np.partition(squares, 1)[1] if len(squares) > 1 else 0.0
    return np.sqrt(nearest)
