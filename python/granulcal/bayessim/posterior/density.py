r"""Posterior densities in the prior's coordinates: one truncated mixture, or a product of several.

Both are zero outside the prior's bounds, normalised, and can be sampled. Numpy only.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.network.mixture import Mixture
from granulcal.prior import Prior

__all__ = ["Density", "TruncatedMixture", "is_inside", "quasi_normal", "quasi_prior"]

Array = NDArray[np.float64]

# Quasi-random points per component for the mass inside the bounds: an error of about 1e-3.
_MASS_POINTS = 2048
# With less mass than this inside the bounds, rejection is wasteful and the mass itself uncertain:
# the density is then integrated over draws of the prior.
_SMALLEST_MASS = 0.02
_PRIOR_POINTS = 20_000


class Density(Protocol):
    """A normalised density over the prior's coordinates, zero outside the prior's bounds."""

    @property
    def mixtures(self) -> tuple[Mixture, ...]:
        """The mixtures that it is made of, one for each pour."""
        ...

    def log_prob(self, u: Array) -> Array:
        """Returns the log density at `u` (n, p), shape (n,)."""
        ...

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` draws, shape (n, p)."""
        ...


@dataclass(frozen=True)
class TruncatedMixture:
    r"""A mixture cut to the prior's bounds: $q(u) 1[u \in B] / Z$ with $Z = \int_B q$.

    Attributes:
        prior: the prior whose bounds B apply.
        mixture: q.
        log_mass: log Z.
    """

    prior: Prior
    mixture: Mixture
    log_mass: float

    @classmethod
    def cut(cls, prior: Prior, mixture: Mixture) -> "TruncatedMixture":
        """Returns `mixture` cut to the bounds of `prior`, Z by quasi-Monte Carlo."""
        if np.all(np.isinf(prior.unconstrained_bounds)):
            return cls(prior, mixture, 0.0)
        points = quasi_normal(_MASS_POINTS, mixture.dimension)
        spreads = np.linalg.inv(mixture.factors)
        placed = mixture.means[:, None] + points @ spreads
        mass = float(mixture.weights @ is_inside(prior, placed).mean(axis=1))
        if mass >= _SMALLEST_MASS:
            return cls(prior, mixture, math.log(mass))
        log_weights = _prior_draws(prior, mixture)[1]
        return cls(prior, mixture, _log_mean_exp(log_weights))

    @property
    def mixtures(self) -> tuple[Mixture, ...]:
        """The one mixture."""
        return (self.mixture,)

    @property
    def is_mostly_outside(self) -> bool:
        """Whether so little mass is inside the bounds that the tail alone shapes the density."""
        return self.log_mass < math.log(_SMALLEST_MASS)

    def log_prob(self, u: Array) -> Array:
        """Returns the log density at `u` (n, p), shape (n,); -inf outside the bounds."""
        inside = is_inside(self.prior, u)
        return np.where(inside, self.mixture.log_prob(u) - self.log_mass, -np.inf)

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` draws inside the bounds, shape (n, p)."""
        if self.is_mostly_outside:
            draws, log_weights = _prior_draws(self.prior, self.mixture)
            weights = np.exp(log_weights - log_weights.max())
            return draws[generator.choice(len(draws), size=n, p=weights / weights.sum())]
        kept: list[Array] = []
        missing = n
        while missing > 0:
            # A tenth more than expected, so that one round is nearly always enough.
            tries = int(1.1 * missing / math.exp(self.log_mass)) + 16
            draws = self.mixture.sample(tries, generator)
            kept.append(draws[is_inside(self.prior, draws)][:missing])
            missing -= len(kept[-1])
        return np.concatenate(kept) if kept else np.empty((0, self.mixture.dimension))


@lru_cache(maxsize=8)
def quasi_uniform(count: int, dimension: int) -> Array:
    """Returns evenly spread points of the unit cube, always the same, shape (count, dimension).

    Additive recurrence on powers of the generalised golden ratio.

    Reference:
        Niederreiter, Random number generation and quasi-Monte Carlo methods, 1992, section 3.1.
    """
    ratio = 2.0
    for _ in range(60):
        ratio = (1 + ratio) ** (1 / (dimension + 1))
    steps = ratio ** -np.arange(1, dimension + 1)
    return (0.5 + np.arange(1, count + 1)[:, None] * steps) % 1


@lru_cache(maxsize=8)
def quasi_normal(count: int, dimension: int) -> Array:
    """Returns evenly spread standard normal points, always the same, shape (count, dimension).

    Evenly spread uniform points carried to the normal by the transform of Box and Muller (Annals of
    Mathematical Statistics 29, 1958).
    """
    uniform = quasi_uniform(count, dimension + dimension % 2)
    radius = np.sqrt(-2 * np.log(1 - uniform[:, 0::2]))
    angle = 2 * np.pi * uniform[:, 1::2]
    normal = np.concatenate([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    return normal[:, :dimension]


@lru_cache(maxsize=8)
def quasi_prior(prior: Prior, count: int) -> Array:
    """Returns evenly spread draws of the prior's coordinates, shape (count, p)."""
    uniform = quasi_uniform(count, len(prior.free))
    columns = [p.quantile(uniform[:, i]) for i, p in enumerate(prior.free)]
    return prior.to_unconstrained(np.column_stack(columns))


def is_inside(prior: Prior, u: Array) -> NDArray[np.bool_]:
    """Returns which points `u` (..., p) lie within the prior's bounds, shape (...)."""
    inside = np.ones(u.shape[:-1], dtype=bool)
    for i, (low, high) in enumerate(prior.unconstrained_bounds):
        inside &= (u[..., i] >= low) & (u[..., i] <= high)
    return inside


def _prior_draws(prior: Prior, mixture: Mixture) -> tuple[Array, Array]:
    draws = prior.to_unconstrained(prior.sample(_PRIOR_POINTS, seed=0))
    return draws, mixture.log_prob(draws) - prior.coordinate_log_prob(draws)


def _log_mean_exp(values: Array) -> float:
    largest = float(values.max())
    return largest + math.log(float(np.mean(np.exp(values - largest))))
