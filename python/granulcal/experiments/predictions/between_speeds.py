r"""The drum's profile and slope without any physics: told from the pictures at two speeds.

| model | at a speed between or beyond |
|---|---|
| `line` | the straight line in the speed through both pictures, height by height |
| `nearest` | the picture of the nearest speed; the mean of both where they are equally near |

Two pictures cannot tell how a height goes on with speed. So the 90 % interval of `line` reaches to
the farther of two other forms through the same pictures, $\ln n$ and $n^2$, and that of `nearest`
as far as the straight line goes from there; each with the pictures' own error in quadrature. No
surface is told beyond the drum's wall.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.loop_drum.task import task
from granulcal.experiments.predictions.interval import HALF_90

__all__ = ["HEIGHT", "MODELS", "SLOPE", "between_speeds", "in_drum", "read_pictures"]

Array = NDArray[np.float64]

# Of one picture: thresholds of 40 to 60 % move heights by 0.3 mm and the slope by 0.2 degrees, and
# its middle and its turn are known to as much.
HEIGHT, SLOPE = 0.4e-3, 0.5
"""One sd of a picture: of its heights [m] and of its slope [degrees]."""
_RADIUS = 0.042
_FORMS: tuple[Callable[[float], float], ...] = (np.log, np.square)


def read_pictures(data: Path) -> tuple[Array, tuple[str, ...], Array]:
    """Returns speeds [1/min], names of the statistics and their values, shape (2, s)."""
    asked = task(data)
    speeds = np.array([float(c.name.split()[0]) for c in asked.conditions])
    values = np.concatenate([c.statistics(asked.scene) for c in asked.conditions])
    return speeds, tuple(asked.scene.observed_names), values


def between_speeds(
    model: str, speeds: Array, values: Array, rpm: float, places: Sequence[float | None]
) -> tuple[Array, Array, Array]:
    """Returns middle, low and high of the statistics at a speed, shape (s,) each.

    Args:
        model: one of `MODELS`.
        speeds: of both pictures, shape (2,).
        values: heights [m] and slope [degrees] of both, shape (2, s).
        rpm: the speed.
        places: x of each height [m]; None for the slope, s of them.
    """
    noise = np.array([SLOPE if x is None else HEIGHT for x in places])
    line = _through(lambda n: n, speeds, values, rpm)
    if model == "line":
        share = _share(lambda n: n, speeds, rpm)
        own = HALF_90 * noise * np.sqrt(share**2 + (1 - share) ** 2 + 1.0)
        others = np.array([line, *(_through(form, speeds, values, rpm) for form in _FORMS)])
        middle = line
        low = line - np.hypot(line - others.min(axis=0), own)
        high = line + np.hypot(others.max(axis=0) - line, own)
    else:
        gaps = np.abs(speeds - rpm)
        near = gaps <= gaps.min()
        middle = values[near].mean(axis=0)
        # Where both are equally near, as far as half of what they differ by.
        reach = np.abs(line - middle) if near.sum() == 1 else 0.5 * np.abs(np.diff(values, axis=0))
        half = np.hypot(np.ravel(reach), HALF_90 * np.sqrt(2.0) * noise)
        low, high = middle - half, middle + half
    return in_drum((middle, low, high), places)


def in_drum(
    told: tuple[Array, Array, Array], places: Sequence[float | None]
) -> tuple[Array, Array, Array]:
    """Returns heights that are no further out than the drum's wall; places as `between_speeds`."""
    wall = np.array([90.0 if x is None else np.sqrt(_RADIUS**2 - x**2) for x in places])
    middle, low, high = (np.clip(v, -wall, wall) for v in told)
    return middle, low, high


def _share(form: Callable[[float], float], speeds: Array, rpm: float) -> float:
    a, b = (float(form(float(n))) for n in speeds)
    return (float(form(rpm)) - a) / (b - a)


def _through(form: Callable[[float], float], speeds: Array, values: Array, rpm: float) -> Array:
    share = _share(form, speeds, rpm)
    return np.asarray((1 - share) * values[0] + share * values[1], dtype=np.float64)


MODELS = ("line", "nearest")
"""Rows without physics."""
