"""What notebooks show of our objects: a small table, and a picture where matplotlib is at hand."""

import base64
import html
import importlib.util
import io
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["page", "picture"]


def page(title: str, rows: Mapping[str, object], image: str = "") -> str:
    """Returns HTML of a title, rows of a table, and an image that `picture` made."""
    head = "<tr><th style='text-align:left'>"
    cells = "".join(
        f"{head}{html.escape(name)}</th><td>{html.escape(str(value))}</td></tr>"
        for name, value in rows.items()
    )
    return f"<div><b>{html.escape(title)}</b><table>{cells}</table>{image}</div>"


def picture(draw: Callable[[Any], object], *, width: float = 4.0, height: float = 3.0) -> str:
    """Returns an image that `draw` has drawn into a matplotlib figure, "" without matplotlib."""
    if importlib.util.find_spec("matplotlib") is None:
        return ""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=100, layout="constrained")
    draw(figure)
    out = io.BytesIO()
    figure.savefig(out, format="png")
    data = base64.b64encode(out.getvalue()).decode()
    return f'<img alt="" src="data:image/png;base64,{data}">'


def seen_from_above(values: NDArray[np.floating], label: str) -> Callable[[Any], object]:
    """Returns what draws an image of numbers, 0 and NaN left out."""

    def draw(figure: Any) -> None:
        axes = figure.subplots()
        shown = np.where(values == 0, np.nan, values)
        drawn = axes.imshow(shown, cmap="viridis")
        axes.set_xticks([])
        axes.set_yticks([])
        figure.colorbar(drawn, ax=axes, label=label)

    return draw
