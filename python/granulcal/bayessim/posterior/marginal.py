"""Marginals of a posterior, and its credible regions."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["CredibleRegion", "Marginal", "kernel_density"]

Array = NDArray[np.float64]


class HasDensity(Protocol):
    """What a region asks of a posterior."""

    def coordinate_log_prob(self, theta: ArrayLike) -> Array:
        """Returns the log density of the coordinates of `theta`, shape (n,)."""
        ...


@dataclass(frozen=True)
class CredibleRegion:
    """Intervals of each parameter and the joint region of highest density.

    The joint region is {density of the coordinates >= threshold}; in coordinates a uniform or
    log-uniform prior is flat, so the region does not depend on the unit of a log parameter.

    Attributes:
        level: probability of the region, and of each interval by itself.
        names: paths of the parameters.
        intervals: central intervals, own units, shape (p, 2).
        log_density_threshold: least log density of the coordinates inside the joint region.
        posterior: where the region comes from.
    """

    level: float
    names: tuple[str, ...]
    intervals: Array
    log_density_threshold: float
    posterior: HasDensity

    def contains(self, theta: ArrayLike) -> NDArray[np.bool_]:
        """Returns whether each row of `theta` (n, p) lies in the joint region, shape (n,)."""
        return self.posterior.coordinate_log_prob(theta) >= self.log_density_threshold

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Returns the interval of one parameter.

        Raises:
            KeyError: there is no such parameter.
        """
        if name not in self.names:
            raise KeyError(f"no parameter {name!r}; there are {', '.join(self.names)}")
        low, high = self.intervals[self.names.index(name)]
        return float(low), float(high)


@dataclass(frozen=True)
class Marginal:
    """Distribution of one parameter alone.

    Attributes:
        name: path of the parameter.
        grid: values, own unit, evenly spaced in the parameter's coordinate, shape (g,).
        density: density of the coordinate at the grid (per unit of prior range), shape (g,).
        median: own unit.
        interval90: central 90 % interval, own unit.
    """

    name: str
    grid: Array
    density: Array
    median: float
    interval90: tuple[float, float]


def kernel_density(draws: Array, bounds: tuple[float, float], grid: int) -> tuple[Array, Array]:
    """Gaussian kernel density of `draws` (n,), reflected at finite bounds."""
    low = max(bounds[0], float(draws.min()) - 0.5 * float(np.ptp(draws)))
    high = min(bounds[1], float(draws.max()) + 0.5 * float(np.ptp(draws)))
    quartiles = np.quantile(draws, [0.25, 0.75])
    spread = min(float(draws.std()), float(np.diff(quartiles)[0]) / 1.34) or 1e-12
    width = 0.9 * spread * len(draws) ** -0.2
    # Binning first makes the cost independent of the number of draws.
    counts, edges = np.histogram(draws, bins=1000, range=(low, high))
    centres = 0.5 * (edges[1:] + edges[:-1])
    width = max(width, 2 * (edges[1] - edges[0]))
    points = np.linspace(low, high, grid)
    density = np.zeros(grid)
    for mirrored in (centres, 2 * low - centres, 2 * high - centres):
        density += np.exp(-0.5 * ((points[:, None] - mirrored) / width) ** 2) @ counts
    return points, density / (len(draws) * width * np.sqrt(2 * np.pi))
