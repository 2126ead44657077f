"""The statistics of a scene by what they are and where or when they are taken."""

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from granulcal.pours.scene import Scene
from granulcal.pours.statistics import ObservedStatistics

_NAME = re.compile(r"(?P<of>[a-z_]+)(\[(?P<at>[^\]]+)\])?")


def observed_of(
    scene: Scene, kinds: dict[str, Callable[[str | None], float]], what: str
) -> ObservedStatistics:
    """Returns the statistics that `scene` observes, those of other kinds as NaN.

    Args:
        scene: the scene whose names are asked for.
        kinds: for each name without brackets, its value given what stands in the brackets.
        what: the measurement in words, for the message.

    Raises:
        ValueError: the scene observes none of these kinds.
    """
    names = scene.observed_names
    values = np.full(len(names), np.nan)
    found = False
    for i, name in enumerate(names):
        parts = _NAME.fullmatch(name)
        if parts is not None and parts["of"] in kinds:
            values[i] = kinds[parts["of"]](parts["at"])
            found = True
    if not found:
        listed = ", ".join(names) or "nothing"
        raise ValueError(f"{what} gives {', '.join(kinds)}, but the scene observes {listed}")
    return ObservedStatistics(values, names)


def value_at(x: NDArray[np.float64], y: NDArray[np.float64], at: float) -> float:
    """Returns y at `at`, linear between finite points; NaN beyond them."""
    known = np.isfinite(x) & np.isfinite(y)
    if not known.any():
        return float("nan")
    return float(np.interp(at, x[known], y[known], left=np.nan, right=np.nan))
