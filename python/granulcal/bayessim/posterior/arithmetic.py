r"""Posteriors of one observation by two ways, averaged as densities.

$$ p(u \mid x) = w \, p_1(u \mid x) + (1 - w) \, p_2(u \mid x) $$

Model files of version 3 mean this by the weight of their emulator. An average of two honest
densities is too wide (Gneiting and Ranjan), which is why models are no longer made so: see
`geometric.py`.

Reference:
    Gneiting and Ranjan, Combining predictive distributions, Electronic Journal of Statistics 7,
    2013.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.density import Density

__all__ = ["StackedDensity"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StackedDensity:
    """The average of two densities over the same coordinates.

    Attributes:
        first: one density.
        second: the other.
        first_weight: weight of the first, between 0 and 1.
    """

    first: Density
    second: Density
    first_weight: float

    @property
    def mixtures(self) -> tuple[Mixture, ...]:
        """The mixtures of both."""
        return (*self.first.mixtures, *self.second.mixtures)

    def log_prob(self, u: Array) -> Array:
        """Returns the log density at `u` (n, p), shape (n,); -inf outside the bounds."""
        with np.errstate(divide="ignore"):
            logs = np.log([self.first_weight, 1 - self.first_weight])
        return np.logaddexp(logs[0] + self.first.log_prob(u), logs[1] + self.second.log_prob(u))

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` draws in random order, shape (n, p)."""
        count = int(generator.binomial(n, self.first_weight))
        parts = [self.first.sample(count, generator), self.second.sample(n - count, generator)]
        return generator.permutation(np.concatenate(parts))
