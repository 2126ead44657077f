"""Which statistics of an archive can be emulated, and how much each of them varies."""

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import TrainingDataError

__all__ = ["spread_of", "usable_statistics"]

Array = NDArray[np.float64]

# A statistic whose most common value has this share of the pours says nothing smooth.
_LARGEST_SHARE = 0.9


def usable_statistics(
    x: Array, labels: tuple[str, ...], base: NDArray[np.bool_]
) -> tuple[NDArray[np.intp], dict[str, str]]:
    """Columns that can be emulated, and why the others cannot; `base` rows are without effects."""
    dropped: dict[str, str] = {}
    for j, label in enumerate(labels):
        known = np.isfinite(x[:, j])
        finite = x[known, j]
        if len(finite) < 0.95 * len(x):
            dropped[label] = f"not finite in {len(x) - len(finite)} of {len(x)} pours"
        elif _is_constant(finite):
            dropped[label] = "constant"
        elif _is_constant(x[known & base, j]):
            # Axes and scales are those of pours without effects.
            dropped[label] = "constant in pours without effects"
        elif np.unique(finite, return_counts=True)[1].max() > _LARGEST_SHARE * len(finite):
            dropped[label] = "one value in more than nine of ten pours"
    kept = [j for j, label in enumerate(labels) if label not in dropped]
    if not kept:
        raise TrainingDataError("no statistic varies over the archive")
    return np.array(kept, dtype=np.intp), dropped


def spread_of(x: Array, base: NDArray[np.bool_]) -> Array:
    """Standard deviation of each statistic over `base` rows, or over all if it is constant there.

    Infinite where it is constant in all: over nothing no distance can be told.
    """
    found = np.nanstd(x[base], axis=0)
    for j, column in enumerate(x.T):
        known = np.isfinite(column)
        if _is_constant(column[known & base]):
            found[j] = np.inf if _is_constant(column[known]) else column[known].std()
    return found


def _is_constant(values: Array) -> bool:
    """Whether values (n,) are one but for rounding, or none."""
    return not values.size or bool(values.std() <= 1e-9 * max(float(np.abs(values).max()), 1e-300))
