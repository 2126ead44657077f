"""Figures of the experiments, in the manner of the paper's."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.pours.formation_image import common_field, height_grid, point_spacing

__all__ = ["ACCENT", "SECOND", "bars", "formations", "new_figure", "posterior_image", "save"]

Array = NDArray[np.float64]

ACCENT, SECOND = "#1f5f8b", "#c8742b"
_GRID, _MM = 130, 1e3


def new_figure(width: float, height: float) -> Any:
    """Returns an empty figure of a size [inch]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def save(figure: Any, path: Path) -> str:
    """Writes the figure as PNG; returns the file's name."""
    figure.savefig(path, dpi=110, format="png")
    return path.name


def formations(
    path: Path, rows: Sequence[Sequence[Array]], labels: Sequence[str], titles: Sequence[str]
) -> str:
    """Draws formations in rows of one field and one colour scale, heights from above.

    Args:
        path: of the PNG.
        rows: points [m] of each formation, each of shape (n, 3), drawn about their middles.
        labels: of the rows.
        titles: of the columns, or of every formation, row by row.
    """
    rows = [[_about_middle(points) for points in row] for row in rows]
    flat = [points for row in rows for points in row]
    field = common_field(flat, share=0.95, sides=2.3)
    columns = max(len(row) for row in rows)
    figure = new_figure(1.55 * columns + 0.9, 1.75 * len(rows))
    axes = figure.subplots(len(rows), columns, squeeze=False)
    # They are of one camera: a grain that lies alone is no wider than one in a heap.
    spacings = [point_spacing(p) for p in flat if len(p) > 1]
    patch = min(spacings, default=None)

    def grid(points: Array) -> Array:
        return _MM * height_grid(points, field=field, pixels=_GRID, patch=patch)

    grids = [[grid(points) for points in row] for row in rows]
    seen = [g for row in grids for g in row if np.isfinite(g).any()]
    tallest = max((float(np.nanmax(g)) for g in seen), default=1.0)
    image = None
    for i, row in enumerate(grids):
        for j in range(columns):
            axis = axes[i, j]
            axis.set_xticks([])
            axis.set_yticks([])
            if j >= len(row):
                axis.set_visible(False)
                continue
            axis.set_facecolor("#20262b")
            image = axis.imshow(row[j], origin="lower", vmin=0, vmax=tallest, cmap="viridis")
            number = i * columns + j
            title = titles[number] if len(titles) > columns else titles[j] if i == 0 else ""
            axis.set_title(title, fontsize=7.5)
            if j == 0:
                axis.set_ylabel(labels[i], fontsize=8)
    if image is not None:
        figure.colorbar(image, ax=axes, label="height [mm]", shrink=0.8)
    return save(figure, path)


def _about_middle(points: Array) -> Array:
    return points - [*points[:, :2].mean(axis=0), 0.0] if len(points) else points


def posterior_image(
    axis: Any, truth: Array, grid: Array, density: Array, title: str, *, is_left: bool = True
) -> None:
    """Draws posteriors as columns of brightness over the truth, as the paper does.

    Args:
        axis: where.
        truth: true values, rising, shape (n,).
        grid: inferred values, shape (g,).
        density: posterior densities, shape (n, g); each column is scaled to its own peak.
        title: above.
        is_left: whether the vertical axis is labelled.
    """
    peak = density.max(axis=1, keepdims=True)
    scaled = (density / np.where(peak > 0, peak, 1)).T
    extent = (truth[0], truth[-1], grid[0], grid[-1])
    axis.imshow(scaled, origin="lower", extent=extent, aspect="auto", cmap="gray")
    axis.plot(extent[:2], extent[:2], color="#d62728", lw=0.8)
    axis.set_title(title, fontsize=8)
    axis.tick_params(labelsize=7)
    axis.set_xlabel("true sliding friction", fontsize=7)
    if is_left:
        axis.set_ylabel("inferred", fontsize=7)


def bars(axis: Any, names: Sequence[str], values: Array, label: str) -> None:
    """Draws horizontal bars, the first on top."""
    places = np.arange(len(names))[::-1]
    axis.barh(places, values, color=ACCENT)
    axis.set_yticks(places, names, fontsize=7)
    axis.set_xlabel(label, fontsize=8)
    axis.tick_params(axis="x", labelsize=7)
