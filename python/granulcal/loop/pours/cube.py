"""Parameters of a prior as coordinates in [0, 1], each by its distribution function."""

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import cube_from_normal
from granulcal.prior import Prior

__all__ = ["cube", "from_cube"]

Array = NDArray[np.float64]


def cube(prior: Prior, theta: Array) -> Array:
    """Returns parameters (n, p) by the distribution function of each."""
    coordinates = prior.to_unconstrained(theta)
    for i, parameter in enumerate(prior.free):
        if parameter.distribution == "normal":
            # Of a normal that is cut to bounds the share between them.
            first, last = cube_from_normal(np.array(parameter.coordinate_bounds))
            shares = cube_from_normal(coordinates[:, i])
            coordinates[:, i] = np.clip((shares - first) / (last - first), 0.0, 1.0)
    return coordinates


def from_cube(prior: Prior, u: Array) -> Array:
    """Returns parameters in own units of unit coordinates (n, p)."""
    return np.column_stack([p.quantile(u[:, i]) for i, p in enumerate(prior.free)])
