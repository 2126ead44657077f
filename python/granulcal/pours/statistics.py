"""The statistics of a granular formation: the paper's 16 numbers and the diagnostic family."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native
from granulcal.arrays import unmasked
from granulcal.real import check_real

__all__ = [
    "DIAGNOSTIC_NAMES",
    "DOCS",
    "NAMES",
    "REGISTRY",
    "UNITS",
    "DiagnosticStatistics",
    "ObservedStatistics",
    "Statistic",
    "Statistics",
    "as_points",
    "diagnostic_statistics",
    "statistics",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Statistic:
    """One entry of the registry: what a number is and how it answers to a change of frame.

    None of them notices a shift of everything along x and y, or the order of the points.

    Attributes:
        family: `paper16` or `diagnostics`.
        name: its name in every file, table and plot.
        unit: `m`, or `-` if dimensionless.
        doc: what it is, in a line.
        length_power: lengths scaled by c scale the value by c to this power.
        rotation: what a rotation by a about the vertical does: `invariant`; `axis`, the value
            belongs to a horizontal axis and changes; `mode m`, the pair of cosine and sine, as a
            complex number, is multiplied by exp(i m a).
        lift: what lifting all points by h does: `invariant`; `rises` by h; `changes`.
    """

    family: str
    name: str
    unit: str
    doc: str
    length_power: int
    rotation: str
    lift: str


REGISTRY: tuple[Statistic, ...] = tuple(Statistic(*row) for row in _native.statistics_table())
"""Every statistic of both families, in order."""
NAMES: tuple[str, ...] = tuple(s.name for s in REGISTRY if s.family == "paper16")
"""Names of the 16 statistics, in the paper's order."""
DIAGNOSTIC_NAMES: tuple[str, ...] = tuple(s.name for s in REGISTRY if s.family == "diagnostics")
"""Names of the diagnostic statistics, in order."""
UNITS: dict[str, str] = {s.name: s.unit for s in REGISTRY}
"""Unit of each statistic."""
DOCS: dict[str, str] = {s.name: s.doc for s in REGISTRY}
"""What each statistic is, in a sentence."""


class _Named:
    """Numbers with names; NumPy takes it for its vector."""

    _names: tuple[str, ...]

    @property
    def _values(self) -> Array:
        raise NotImplementedError

    @property
    def names(self) -> list[str]:
        """Names of the statistics, in order."""
        return list(self._names)

    def to_dict(self) -> dict[str, float]:
        """Returns the values by name."""
        return dict(zip(self._names, self._values.tolist(), strict=True))

    def __getitem__(self, name: str) -> float:
        if name not in self._names:
            raise KeyError(f"no statistic {name!r}; there are {', '.join(self._names)}")
        return float(self._values[self._names.index(name)])

    def keys(self) -> list[str]:
        """Returns the names: with them `dict(...)` has the values by name."""
        return self.names

    def __contains__(self, name: object) -> bool:
        """Whether a statistic has this name; a value is not looked for."""
        return isinstance(name, str) and name in self._names

    def __iter__(self) -> Iterator[float]:
        return iter(self._values.tolist())

    def __len__(self) -> int:
        return len(self._values)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self._values, dtype=dtype, copy=True if copy is None else copy)

    def __eq__(self, other: object) -> bool:
        """Whether the other is of the same kind, names and values; NaN is as NaN."""
        if not isinstance(other, _Named) or type(other) is not type(self):
            return NotImplemented
        same = np.array_equal(other._values, self._values, equal_nan=True)
        return other.names == self.names and same

    def __hash__(self) -> int:
        # One zero, and one NaN.
        values = np.nan_to_num(np.asarray(self._values, float)) + 0.0
        return hash((tuple(self._names), values.tobytes()))

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.4g}" for name, value in self.to_dict().items())
        return f"{type(self).__name__}({shown})"

    def _require_shape(self, argument: str) -> None:
        if np.shape(self._values) != (len(self._names),):
            found = np.shape(self._values)
            raise ValueError(f"{argument} must have shape ({len(self._names)},), got {found}")


@dataclass(frozen=True, eq=False, repr=False)
class Statistics(_Named):
    """The 16 statistics of one formation; NumPy takes it for its vector.

    Attributes:
        paper16: values in the paper's order, SI units, shape (16,).
    """

    paper16: Array
    _names = NAMES

    def __post_init__(self) -> None:
        self._require_shape("paper16")

    @property
    def _values(self) -> Array:
        return self.paper16


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosticStatistics(_Named):
    """The diagnostic statistics of one formation; NumPy takes it for its vector.

    They say where two formations differ: the radial profile of the height and its slope, azimuthal
    modes of mass and rim, isolated grains and clusters, the tail, the depth of the middle.

    Attributes:
        values: values in the order of `DIAGNOSTIC_NAMES`, SI units, shape (d,).
    """

    values: Array
    _names = DIAGNOSTIC_NAMES

    def __post_init__(self) -> None:
        self._require_shape("values")

    @property
    def _values(self) -> Array:
        return self.values


@dataclass(frozen=True, eq=False, repr=False)
class ObservedStatistics(_Named):
    """The statistics that a scene observes, of a pour or measured; NumPy takes it for its vector.

    Attributes:
        values: values in the order of the scene, shape (k,); NaN for what could not be seen.
        of: their names, as `Scene.observed_names` tells them.
    """

    values: Array
    of: tuple[str, ...]

    def __post_init__(self) -> None:
        self._require_shape("values")

    @property
    def _names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        return self.of

    @property
    def _values(self) -> Array:
        return self.values


def statistics(points: ArrayLike) -> Statistics:
    """Returns the statistics of the points of a formation.

    Args:
        points: points of the grains over the ground z = 0 [m], shape (n, 3); the vertical axis
            through their centroid is the axis of the radii.

    Raises:
        TypeError: `points` does not hold real numbers.
        ValueError: another shape, a value that is masked or not finite, or fewer than 3 points.

    Examples:
        >>> ring = [[0.05, 0, 0.004], [0, 0.05, 0.004], [-0.05, 0, 0.004], [0, -0.05, 0.004]]
        >>> round(statistics(ring)["mean_r"], 3)
        0.05
    """
    return Statistics(_native.paper16(as_points("points", points)))


def diagnostic_statistics(
    points: ArrayLike,
    *,
    grain_diameter: float,
    spacing: float,
    pour_axis: tuple[float, float] | None = None,
) -> DiagnosticStatistics:
    """Returns the diagnostic statistics of the points of a formation.

    Args:
        points: points of the grains over the ground z = 0 [m], shape (n, 3).
        grain_diameter: diameter of a grain [m]; larger bodies are more than one.
        spacing: distance of neighbouring points on the ground [m], the side of a pixel there.
        pour_axis: x and y where the axis of the pour meets the ground [m]; the centroid if None,
            which hides modes of order 1.

    Raises:
        TypeError: `points` does not hold real numbers, or a length is none.
        ValueError: another shape, a value that is masked or not finite, fewer than 3 points, or a
            length out of range.

    Examples:
        >>> side = np.arange(-0.05, 0.05, 1e-3)
        >>> x, y = (axis.ravel() for axis in np.meshgrid(side, side))
        >>> z = 0.4 * (0.04 - np.hypot(x, y))
        >>> cone = np.stack([x, y, z], axis=1)[z > 0]
        >>> found = diagnostic_statistics(cone, grain_diameter=0.004, spacing=1e-3)
        >>> round(found["profile_slope"], 1), found["ring_depth"]
        (-0.4, 1.0)
    """
    check_real("grain_diameter", grain_diameter)
    check_real("spacing", spacing)
    values = _native.diagnostics(
        as_points("points", points),
        grain_diameter=grain_diameter,
        spacing=spacing,
        pour_axis=None if pour_axis is None else _axis(pour_axis),
    )
    return DiagnosticStatistics(values)


def _axis(value: object) -> tuple[float, float]:
    """A place on the ground, of whatever holds two numbers."""
    try:
        x, y = np.asarray(value, dtype=np.float64).tolist()
        return float(x), float(y)
    except (TypeError, ValueError):
        raise TypeError(f"pour_axis must be two numbers (x, y) [m], got {value!r}") from None


def as_points(name: str, value: ArrayLike) -> Array:
    """Returns `value` as a contiguous float64 array; copies only what is not one already.

    Raises:
        TypeError: `value` does not hold real numbers.
        ValueError: entries are masked.
    """
    array = unmasked(name, value)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} must hold real numbers, got dtype {array.dtype}")
    return np.ascontiguousarray(array, dtype=np.float64)
