r"""Faults of the measurement of a series or of a profile: operators on what was read, no pour.

For scenes that observe statistics of their own, where images have those of `image_faults.py`. With
X(t) linear between the stated times, z(x) between the stated x, both carried on beyond the
outermost,

| kind | the measurement reads | what it stands for |
|---|---|---|
| `clock_offset` | X(t + o) | the release is told wrongly, by a frame or by the start of a drive |
| `clock_scale` | X(t (1 + s)) | the frame rate is not what was stated |
| `length_scale` | (1 + s) X of lengths | the size of a pixel |
| `frame_x` | z(x + o) | the picture's middle is not the drum's |
| `frame_z` | z + o | its height |
| `frame_turn` | z - a x, slope + a | the camera is turned about its axis by a |

A series' value at its end has no time, and is moved by no clock.
"""

import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import ObservationError
from granulcal.pours.scene import Scene

__all__ = ["KINDS", "require_series", "reread"]

Array = NDArray[np.float64]

KINDS = (
    "clock_offset",
    "clock_scale",
    "length_scale",
    "frame_x",
    "frame_z",
    "frame_turn",
)
"""What an effect of the measurement may be, in the order in which they act."""

_NAME = re.compile(r"(?P<of>[a-z_]+)\[(?P<at>[^\]]+)\]")
_OVER_TIME = ("front_radius", "liquid_radius", "discharged")
_OVER_X = ("surface_z",)
_LENGTHS = ("front_radius", "liquid_radius", "surface_z", "radius")
_SLOPE = "surface_slope"


def reread(names: Sequence[str], rows: Array, faults: Mapping[str, ArrayLike]) -> Array:
    """Returns observed statistics as a faulty measurement reads them.

    Args:
        names: of the statistics, s of them.
        rows: values, shape (n, s).
        faults: by kind, a number for all rows or one for each, shape (n,): offsets of the clock
            [s], of the frame [m], its turn [rad], scales without unit.
    """
    out = np.array(rows, dtype=np.float64)
    count = len(out)
    value = {
        kind: np.broadcast_to(np.asarray(faults.get(kind, 0.0), dtype=np.float64), (count,))
        for kind in KINDS
    }
    for name in _OVER_TIME:
        columns, at = _along(names, name)
        if len(columns) > 1:
            moved = at * (1 + value["clock_scale"][:, None]) + value["clock_offset"][:, None]
            out[:, columns] = _read(at, out[:, columns], moved)
    for name in _OVER_X:
        columns, at = _along(names, name)
        if len(columns) > 1:
            out[:, columns] = _read(at, out[:, columns], at + value["frame_x"][:, None])
            out[:, columns] += value["frame_z"][:, None] - value["frame_turn"][:, None] * at
    for j, name in enumerate(names):
        if name.partition("[")[0] in _LENGTHS:
            out[:, j] *= 1 + value["length_scale"]
        if name == _SLOPE:
            out[:, j] += np.degrees(value["frame_turn"])
    return out


def require_series(scene: Scene, effects: Iterable[tuple[str, str]]) -> None:
    """Refuses effects of the measurement for a scene that observes nothing they act on.

    Args:
        scene: the scene.
        effects: name and kind of each.

    Raises:
        ObservationError: the effect, and what it needs.
    """
    names = scene.observed_names
    probe = np.linspace(0.1, 0.2, max(len(names), 1))[None] ** 2
    for name, kind in effects:
        if not names or np.array_equal(reread(names, probe, {kind: 1e-3}), probe):
            raise ObservationError(
                f"{name} acts on what a scene observes over time or along x (front_radius[t], "
                f"discharged[t], surface_z[x]); this one observes {', '.join(names) or 'nothing'}"
            )


def _along(names: Sequence[str], wanted: str) -> tuple[NDArray[np.intp], Array]:
    """Columns of a series by what stands in their brackets, and that; `end` is none."""
    found = []
    for j, name in enumerate(names):
        parts = _NAME.fullmatch(name)
        if parts is not None and parts["of"] == wanted and parts["at"] != "end":
            found.append((float(parts["at"]), j))
    found.sort()
    return np.array([j for _, j in found], dtype=np.intp), np.array([at for at, _ in found])


def _read(at: Array, values: Array, moved: Array) -> Array:
    """Values (n, k) at `at` (k,), read at `moved` (n, k): linear, carried on beyond the ends."""
    i = np.clip(np.searchsorted(at, moved) - 1, 0, len(at) - 2)
    share = (moved - at[i]) / (at[i + 1] - at[i])
    low, high = (np.take_along_axis(values, k, axis=1) for k in (i, i + 1))
    return low + share * (high - low)
