"""Picture of a plan: the predicted height map beside the distances from the axis."""

from os import PathLike
from typing import Any

import numpy as np

from granulcal.design.lines import colour_of
from granulcal.design.pattern import Pattern
from granulcal.design.plan import Plan
from granulcal.files import save_figure
from granulcal.pours.camera import Camera

__all__ = ["plan_picture"]

_PIXELS = 500
_CAMERA_HEIGHT = 1.0
_CM, _MM = 1e2, 1e3
_TURN = np.linspace(0, 2 * np.pi, 361)


def plan_picture(plan: Plan, pattern: Pattern, path: str | PathLike[str]) -> None:
    """Writes a PNG: the height map with the wanted radii, and the distances from the axis.

    Args:
        plan: what was wanted.
        pattern: what was simulated.
        path: of the file.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    widest = max(p.wanted_outer for p in plan.pours)
    field = max(3.2 * widest, 0.1)
    figure = Figure(figsize=(11, 5), layout="constrained")
    FigureCanvasAgg(figure)
    seen, far = figure.subplots(1, 2)
    _draw_heights(seen, plan, pattern, field, figure)
    _draw_distances(far, plan, pattern, field)
    save_figure(figure, path, dpi=80)


def _draw_heights(axis: Any, plan: Plan, pattern: Pattern, field: float, figure: Any) -> None:
    from matplotlib.colors import PowerNorm

    # From far above the picture is nearly that of parallel rays.
    camera = Camera.overhead(height=_CAMERA_HEIGHT, field_width=field, pixels=_PIXELS)
    depth = camera.render(pattern.positions, pattern.radii)
    heights = np.where(depth > 0, _MM * (_CAMERA_HEIGHT - depth), np.nan)
    half = _CM * field / 2
    image = axis.imshow(
        np.where(heights > 0.1, heights, np.nan),
        extent=(-half, half, -half, half),
        cmap="viridis",
        # A square root, so that a single layer is seen beside a pile.
        norm=PowerNorm(0.5, vmin=0),
    )
    axis.set_facecolor("#20262b")
    for p in plan.pours:
        colour = colour_of(p.order - 1)
        for radius, style in ((p.wanted_inner, ":"), (p.wanted_outer, "--")):
            if radius is not None:
                x, y = _CM * radius * np.cos(_TURN), _CM * radius * np.sin(_TURN)
                axis.plot(x, y, style, color="white", linewidth=2.6)
                axis.plot(x, y, style, color=colour, linewidth=1.4)
    axis.set(xlabel="x [cm]", ylabel="y [cm]", xlim=(-half, half), ylim=(-half, half))
    axis.set_title("predicted height of the grains; circles: wanted radii")
    figure.colorbar(image, ax=axis, label="height above the ground [mm]", shrink=0.85)


def _draw_distances(axis: Any, plan: Plan, pattern: Pattern, field: float) -> None:
    distance = _CM * np.hypot(pattern.positions[:, 0], pattern.positions[:, 1])
    bins = np.linspace(0, _CM * field / 2, 81)
    for i, p in enumerate(plan.pours):
        colour, own = colour_of(i), distance[pattern.pour == i]
        label = f"pour {p.order} from {_CM * p.height:.1f} cm"
        label += " (extrapolated)" if p.is_extrapolated else ""
        if farther := int((own > bins[-1]).sum()):
            label += f"; {farther} of {len(own)} grains farther out"
        axis.hist(own, bins, color=colour, alpha=0.55, label=label)
        if p.wanted_inner is not None:
            axis.axvline(_CM * p.wanted_inner, color=colour, linestyle=":")
        axis.axvline(_CM * p.wanted_outer, color=colour, linestyle="--")
    axis.set(xlabel="distance from the axis [cm]", ylabel="grains")
    axis.set_title("dotted: wanted inner radius, dashed: outer")
    # Below the axes: the bars may be high anywhere.
    axis.legend(loc="upper left", bbox_to_anchor=(0, -0.12), frameon=False)
