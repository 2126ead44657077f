"""Maps of a group and pours of the verdict's model at its fit, as heights; how they look."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.loop_rings.shape import Shape, measured, profile, simulated
from granulcal.loop.closed import Closed
from granulcal.loop.task import FIT, SEALED
from granulcal.pours.simulate import simulate

__all__ = ["Seen", "look", "table"]

Array = NDArray[np.float64]

# Pours at the fit, and their first seed: apart from those that the loop has made.
_POURS, _SEED = 10, 900_000


@dataclass(frozen=True)
class Seen:
    """Heights over the bed [m], each with the spacing of its pixels [m].

    Attributes:
        maps: by name, those that were fitted first.
        sealed: names of those that were not.
        pours: of the verdict's model at its fit.
    """

    maps: dict[str, tuple[Array, float]]
    sealed: tuple[str, ...]
    pours: list[tuple[Array, float]]


def look(closed: Closed) -> Seen:
    """Reads the maps and pours the verdict's model."""
    task, maps, sealed = closed.task, {}, []
    for use in (FIT, SEALED):
        for condition in task.of(use):
            for path in condition.recordings:
                maps[path.stem] = measured(path, condition.reading)
                sealed += [path.stem] if use == SEALED else []
    scene = closed.scene(task.of(FIT)[0], closed.trace.best)
    pours = [simulated(simulate(scene, seed=_SEED + i)) for i in range(_POURS)]
    return Seen(maps, tuple(sealed), pours)


def table(seen: Seen) -> list[str]:
    """Returns depth and rim of every map beside the range of the pours, as Markdown.

    A number within that range is marked.
    """
    fields = ("depth", "rim", "radius")
    pours = [Shape.of(*profile(*pour)) for pour in seen.pours]
    ranges = [_range([getattr(one, field) for one in pours]) for field in fields]
    lines = [
        "| | depth of the crater [mm] | height of the rim [mm] | radius of the rim [mm] |",
        "|---|---|---|---|",
        "| " + " | ".join(["pours at the fit", *(f"{a:.1f} to {b:.1f}" for a, b in ranges)]) + " |",
    ]
    for name, one in seen.maps.items():
        shape = Shape.of(*profile(*one))
        cells = [f"{name}{' (sealed)' if name in seen.sealed else ''}"]
        for field, (low, high) in zip(fields, ranges, strict=True):
            value = 1e3 * getattr(shape, field)
            cells.append(f"**{value:.1f}**" if low <= value <= high else f"{value:.1f}")
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def _range(values: list[float]) -> tuple[float, float]:
    """Least and largest [mm]."""
    return 1e3 * min(values), 1e3 * max(values)
