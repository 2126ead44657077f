"""The paper's 16 numbers of a granular formation."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native

__all__ = ["DOCS", "NAMES", "UNITS", "Statistics", "as_points", "statistics"]

Array = NDArray[np.float64]

_TABLE = _native.statistics_table()
NAMES: tuple[str, ...] = tuple(name for name, _, _ in _TABLE)
"""Names of the statistics, in the paper's order."""
UNITS: dict[str, str] = {name: unit for name, unit, _ in _TABLE}
"""Unit of each statistic."""
DOCS: dict[str, str] = {name: doc for name, _, doc in _TABLE}
"""What each statistic is, in a sentence."""


@dataclass(frozen=True, eq=False)
class Statistics:
    """The 16 statistics of one formation; NumPy takes it for its vector.

    Attributes:
        paper16: values in the paper's order, SI units, shape (16,).
    """

    paper16: Array

    def __post_init__(self) -> None:
        if np.shape(self.paper16) != (len(NAMES),):
            raise ValueError(
                f"paper16 must have shape ({len(NAMES)},), got {np.shape(self.paper16)}"
            )

    @property
    def names(self) -> list[str]:
        """Names of the statistics, in the paper's order."""
        return list(NAMES)

    def to_dict(self) -> dict[str, float]:
        """Returns the values by name."""
        return dict(zip(NAMES, self.paper16.tolist(), strict=True))

    def __getitem__(self, name: str) -> float:
        if name not in NAMES:
            raise KeyError(f"no statistic {name!r}; there are {', '.join(NAMES)}")
        return float(self.paper16[NAMES.index(name)])

    def __iter__(self) -> Iterator[float]:
        return iter(self.paper16.tolist())

    def __len__(self) -> int:
        return len(self.paper16)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.paper16, dtype=dtype, copy=True if copy is None else copy)

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={value:.4g}" for name, value in self.to_dict().items())
        return f"Statistics({shown})"


def statistics(points: ArrayLike) -> Statistics:
    """Returns the statistics of the points of a formation.

    Args:
        points: points of the grains over the ground z = 0 [m], shape (n, 3); the vertical axis
            through their centroid is the axis of the radii.

    Raises:
        TypeError: `points` does not hold real numbers.
        ValueError: another shape, a value that is not finite, or too few points.

    Example:
        >>> ring = [[0.05, 0, 0.004], [0, 0.05, 0.004], [-0.05, 0, 0.004], [0, -0.05, 0.004]]
        >>> round(statistics(ring)["mean_r"], 3)
        0.05
    """
    return Statistics(_native.paper16(as_points("points", points)))


def as_points(name: str, value: ArrayLike) -> Array:
    """Returns `value` as a contiguous float64 array; copies only what is not one already.

    Raises:
        TypeError: `value` does not hold real numbers.
    """
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} must hold real numbers, got dtype {array.dtype}")
    return np.ascontiguousarray(array, dtype=np.float64)
