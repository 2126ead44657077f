"""Measured rings beside pours of the base model and of the most probable effect, and profiles."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.closed import Closed
from granulcal.loop.task import FIT
from granulcal.measured.recording import Recording
from granulcal.pours.formation_image import height_grid
from granulcal.pours.simulate import simulate

__all__ = ["picture"]

Array = NDArray[np.float64]

# Side of the square that is shown, and width of a ring of the profiles [m].
_FIELD, _RING = 0.36, 6e-3
_PIXELS = 120
_SEED = 7


def picture(path: Path, closed: dict[str, Closed]) -> None:
    """Draws a column for each group."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shape = (4, len(closed))
    figure, axes = plt.subplots(
        *shape, figsize=(3.1 * shape[1], 11), squeeze=False, layout="constrained"
    )
    image = None
    for (group, one), column in zip(closed.items(), axes.T, strict=True):
        fitted = one.task.of(FIT)[0]
        first = fitted.recordings[0]
        heights, radius = _measured(first, fitted.reading)
        rows = [(f"{group}: {first.stem}", heights)]
        column[3].plot(*_profile(radius, heights), "k", label="measured")
        models = [("rigid plane", one.trace.base)]
        if one.trace.explanations:
            best = one.trace.explanations[0]
            models.append((f"with {' + '.join(best.effects)}", best))
        for name, model in models:
            pour = simulate(one.scene(fitted, model), seed=_SEED)
            points = pour.points() - np.array([*pour.points()[:, :2].mean(axis=0), 0.0])
            rows.append((name, height_grid(points, field=_FIELD, pixels=_PIXELS)))
            column[3].plot(*_profile(*_radii(rows[-1][1])), label=name)
        for axis, (name, shown) in zip(column[:3], rows, strict=False):
            image = axis.imshow(
                1e3 * np.nan_to_num(shown), origin="lower", vmin=-15, vmax=15, cmap="RdBu_r"
            )
            axis.set_title(name, fontsize=9)
        for axis in column[:3]:
            axis.set_axis_off()
        column[3].axhline(0, color="0.7", lw=0.8)
        column[3].set(xlabel="radius [mm]", ylabel="mean height [mm]", xlim=(0, 180))
        column[3].legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.25))
    assert image is not None
    figure.colorbar(image, ax=axes[:3], label="height above the bed [mm]", shrink=0.6)
    figure.savefig(path, dpi=62)
    plt.close(figure)


def _measured(path: Path, reading: dict[str, Any]) -> tuple[Array, Array]:
    """Returns heights over the bed [m] in the square about the ring, NaN outside, and radii."""
    level = Recording.open(path).level(**reading)
    width = level.resolution[0]
    # The middle of the rim, which is what stands above the bed.
    middle = [int(np.median(where)) for where in np.nonzero(level.mask)]
    half = int(0.5 * _FIELD / width)
    padded = np.pad(level.heights, half, constant_values=np.nan)
    grid = padded[tuple(slice(at, at + 2 * half + 1) for at in middle)]
    along = width * np.arange(-half, half + 1)
    return grid, np.hypot(along[:, None], along[None])


def _radii(grid: Array) -> tuple[Array, Array]:
    side = _FIELD / len(grid)
    along = side * (np.arange(len(grid)) - 0.5 * (len(grid) - 1))
    return np.hypot(along[:, None], along[None]), np.nan_to_num(grid)


def _profile(radius: Array, heights: Array) -> tuple[Array, Array]:
    """Mean height in rings: radii [mm], heights [mm]."""
    edges = np.arange(0.0, 0.18 + _RING, _RING)
    rings = np.digitize(radius.ravel(), edges) - 1
    flat = heights.ravel()
    means = [
        float(np.nanmean(flat[rings == i])) if np.isfinite(flat[rings == i]).any() else np.nan
        for i in range(len(edges) - 1)
    ]
    return 1e3 * (edges[:-1] + 0.5 * _RING), 1e3 * np.array(means)
