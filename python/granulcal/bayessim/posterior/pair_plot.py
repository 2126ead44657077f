"""Figure of a posterior: marginals on the diagonal, pairs below it."""

import textwrap
from os import PathLike
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.arrays import as_matrix
from granulcal.bayessim.posterior.marginal import Marginal
from granulcal.files import save_figure
from granulcal.prior import Prior
from granulcal.short_names import short_names

if TYPE_CHECKING:
    from matplotlib.figure import Figure


__all__ = ["pair_plot"]

Array = NDArray[np.float64]

_COLOUR, _EXTRA_COLOUR, _TRUTH_COLOUR = "#1f5f8b", "#c8742b", "#b3202a"
_LEVELS = (0.9, 0.5)
_BINS = 50
# Spread, in bins, of the smoothing of the two-dimensional histograms.
_SMOOTHING = 1.5
_DRAWS = 20_000
_PANEL_INCHES = 2.3
# Sizes of what stands over and below the figure, and how wide a letter is over its size [-].
_TITLE, _CAPTION, _LETTER = 10, 8, 0.6
_POINTS_PER_INCH = 72


class Drawn(Protocol):
    """What the figure asks of a posterior."""

    prior: Prior

    @property
    def names(self) -> list[str]:
        """Paths of the free parameters."""
        ...

    def mode(self) -> Array:
        """Returns the most probable parameters, own units, shape (p,)."""
        ...

    def sample(self, n: int, seed: int = 0) -> Array:
        """Returns draws, own units, shape (n, p)."""
        ...

    def marginals(self) -> dict[str, Marginal]:
        """Returns the marginal of each parameter by name."""
        ...


def pair_plot(
    posterior: Drawn,
    *,
    path: str | PathLike[str] | None = None,
    truth: ArrayLike | None = None,
    extra: Drawn | None = None,
    title: str = "",
) -> "Figure":
    """Returns the figure; axes span the prior's bounds, log parameters have log axes.

    Contours hold 50 % and 90 % of the draws; a white-edged dot marks the mode, a red cross and
    lines the truth, as the figure says below itself.

    Args:
        posterior: what to draw.
        path: where to save the figure, or None.
        truth: true parameters, own units, shape (p,).
        extra: another posterior of the same parameters, drawn in a second colour.
        title: over the figure.

    Raises:
        TypeError: `extra` is no posterior.
        ValueError: `truth` has another shape, or `extra` other parameters.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = posterior.names
    if extra is not None and not hasattr(extra, "marginals"):
        raise TypeError(f"extra must be a Posterior, got {extra!r}")
    if extra is not None and extra.names != names:
        raise ValueError(f"extra must have the parameters {names}, got {extra.names}")
    true_values = None if truth is None else as_matrix("truth", truth, columns=len(names))[0]
    count = len(names)
    side = _PANEL_INCHES * count + 0.6
    figure = Figure(figsize=(side, side), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(count, count, squeeze=False)
    labels = _labels([p.path for p in posterior.prior.free])
    for row in range(count):
        for column in range(count):
            _frame(axes[row][column], posterior, labels, row, column)
    shown = [(posterior, _COLOUR)] + ([(extra, _EXTRA_COLOUR)] if extra is not None else [])
    for each, colour in shown:
        _draw(axes, each, colour)
    unseen: list[str] = []
    if true_values is not None:
        ends = [_limits(posterior, i) for i in range(count)]
        is_shown = [
            low <= value <= high for value, (low, high) in zip(true_values, ends, strict=True)
        ]
        _mark_truth(axes, true_values, is_shown)
        unseen = [label for label, shows in zip(labels, is_shown, strict=True) if not shows]
    if title:
        figure.suptitle(_wrapped(title, side, _TITLE), fontsize=_TITLE)
    told = _caption(count, has_truth=true_values is not None, has_extra=extra is not None)
    if unseen:
        told += f" The truth lies beyond the axis of {', '.join(unseen)}."
    figure.supxlabel(_wrapped(told, side, _CAPTION), fontsize=_CAPTION)
    if path is not None:
        save_figure(figure, path, dpi=160)
    return figure


def _labels(paths: list[str]) -> list[str]:
    """Names of the axes; beside a material's the word before says whose height or x it is."""
    found = []
    for path, name in zip(paths, short_names(paths), strict=True):
        parts = path.split(".")
        is_bare = "." not in name and len(parts) > 1 and parts[0] != "material"
        found.append((f"{parts[-2]} {name}" if is_bare else name).replace("_", " "))
    return found


def _caption(count: int, *, has_truth: bool, has_extra: bool) -> str:
    """What the marks of a figure of so many parameters are."""
    regions = (
        "Shaded: 50 % and 90 % of the posterior. Dot and dotted line: its mode, of all together."
    )
    told = regions if count > 1 else "Dotted: the mode."
    if has_truth:
        told += " Red: the truth."
    if has_extra:
        told += " Orange: the other posterior."
    return f"{told} SI units."


def _wrapped(text: str, inches: float, size: float) -> str:
    """Breaks a text into lines that the figure's width holds."""
    letters = int(inches * _POINTS_PER_INCH / (_LETTER * size))
    return textwrap.fill(text, max(letters, 1))


def _frame(axis: Any, posterior: Drawn, labels: list[str], row: int, column: int) -> None:
    """Sets limits, scales and labels of one panel, or hides it above the diagonal."""
    if column > row:
        axis.set_visible(False)
        return
    from matplotlib.ticker import NullFormatter

    parameters = posterior.prior.free
    if parameters[column].is_log:
        axis.set_xscale("log")
        axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlim(_limits(posterior, column))
    if row != column:
        if parameters[row].is_log:
            axis.set_yscale("log")
            axis.yaxis.set_minor_formatter(NullFormatter())
        axis.set_ylim(_limits(posterior, row))
    else:
        axis.set_yticks([])
        axis.spines[["left", "right", "top"]].set_visible(False)
    is_last = row == len(parameters) - 1
    axis.tick_params(labelsize=8, labelbottom=is_last, labelleft=column == 0 and row != column)
    if is_last:
        axis.set_xlabel(labels[column], fontsize=9)
    if column == 0 and row != 0:
        axis.set_ylabel(labels[row], fontsize=9)


def _draw(axes: Any, posterior: Drawn, colour: str) -> None:
    mode = posterior.mode()
    draws = posterior.prior.to_unconstrained(posterior.sample(_DRAWS, seed=0))
    for i, marginal in enumerate(posterior.marginals().values()):
        axis = axes[i][i]
        axis.plot(marginal.grid, marginal.density, color=colour, linewidth=1.6)
        axis.fill_between(marginal.grid, marginal.density, color=colour, alpha=0.15, linewidth=0)
        axis.axvline(mode[i], color=colour, linewidth=1, linestyle=":")
        axis.set_ylim(bottom=0)
    for row in range(1, len(mode)):
        for column in range(row):
            axis = axes[row][column]
            _contours(axis, posterior, draws, column, row, colour)
            axis.plot(
                mode[column], mode[row], "o", color=colour, markeredgecolor="white", markersize=6
            )


def _contours(
    axis: Any, posterior: Drawn, draws: Array, column: int, row: int, colour: str
) -> None:
    """Fills the regions of highest smoothed histogram density that hold the levels."""
    parameters = posterior.prior.free
    ranges = []
    for i in (column, row):
        values = np.array(_limits(posterior, i))
        ranges.append(tuple(parameters[i].to_coordinate(values)))
    counts, x_edges, y_edges = np.histogram2d(
        draws[:, column], draws[:, row], bins=_BINS, range=ranges
    )
    smooth = _smoothed(counts)
    order = np.sort(smooth.ravel())[::-1]
    held = np.cumsum(order) / order.sum()
    thresholds = [order[np.searchsorted(held, level)] for level in _LEVELS]
    x = parameters[column].from_coordinate(_middles(x_edges))
    y = parameters[row].from_coordinate(_middles(y_edges))
    # As far as the bounds, where many truths lie, and not half a bin short of them.
    smooth = np.pad(smooth, 1, mode="edge")
    for low, alpha in zip(thresholds, (0.25, 0.45), strict=True):
        top = max(smooth.max(), low) * 1.0001
        axis.contourf(x, y, smooth.T, levels=[low, top], colors=[colour], alpha=alpha)
    axis.contour(x, y, smooth.T, levels=sorted(set(thresholds)), colors=[colour], linewidths=0.8)


def _middles(edges: Array) -> Array:
    """Middles of bins, between the two ends of all."""
    return np.concatenate([edges[:1], 0.5 * (edges[1:] + edges[:-1]), edges[-1:]])


def _smoothed(counts: Array) -> Array:
    """Gaussian smoothing along both axes, mirrored at the edges."""
    reach = int(4 * _SMOOTHING)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / _SMOOTHING) ** 2)
    kernel /= kernel.sum()
    for axis in (0, 1):
        width = [(reach, reach) if i == axis else (0, 0) for i in (0, 1)]
        padded = np.pad(counts, width, mode="symmetric")
        counts = np.apply_along_axis(np.convolve, axis, padded, kernel, mode="valid")
    return counts


def _mark_truth(axes: Any, truth: Array, is_shown: list[bool]) -> None:
    """Marks the truth where the axes reach it; at their ends, too, whole."""
    for row in range(len(truth)):
        if not is_shown[row]:
            continue
        axes[row][row].axvline(truth[row], color=_TRUTH_COLOUR, linewidth=1.2, clip_on=False)
        for column in range(row):
            if is_shown[column]:
                axes[row][column].plot(
                    *(truth[column], truth[row], "x"),
                    color=_TRUTH_COLOUR,
                    markersize=8,
                    clip_on=False,
                    zorder=5,
                )


def _limits(posterior: Drawn, i: int) -> tuple[float, float]:
    """The prior's bounds, or its central 99.8 % where it has none."""
    low, high = posterior.prior.free[i].bounds
    near = posterior.prior.free[i].quantile(np.array([0.001, 0.999]))
    return (
        low if np.isfinite(low) else float(near[0]),
        high if np.isfinite(high) else float(near[1]),
    )
