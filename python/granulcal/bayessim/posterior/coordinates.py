"""A prior's coordinates as the extension knows them, and evenly spread draws of them."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.prior import Prior

__all__ = ["coordinates_of", "quasi_prior"]

Array = NDArray[np.float64]


@lru_cache(maxsize=16)
def coordinates_of(prior: Prior) -> _native.Coordinates:
    """Returns the coordinates of a prior, made once."""
    return _native.Coordinates(prior.to_toml())


@lru_cache(maxsize=8)
def quasi_prior(prior: Prior, count: int) -> Array:
    """Returns evenly spread draws of the prior's coordinates, always the same, shape (count, p)."""
    return coordinates_of(prior).quasi_prior(count)
