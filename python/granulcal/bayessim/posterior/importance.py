r"""A density known up to a factor, by importance sampling with an adapted proposal.

The density is evaluated point by point; its normaliser and its draws come from weighted draws of a
mixture that is adapted to it: kernel estimates of the weighted draws, tempered while too few carry
weight, always with a share as wide as what is known beforehand. A draw of the density is a weighted
draw that then walks a few steps of Metropolis, along differences of other draws: without them a
thousand draws are some hundred points, each several times.

Reference:
    Cappe, Guillin, Marin and Robert, Population Monte Carlo, JCGS 13, 2004.
    Gilks and Berzuini, Following a moving target: Monte Carlo inference for dynamic Bayesian
    models, JRSS B 63, 2001 (resample, then move).
    Ter Braak, A Markov chain Monte Carlo version of the genetic algorithm differential evolution,
    Statistics and Computing 16, 2006 (steps along differences).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.density import is_inside
from granulcal.prior import Prior

__all__ = ["Effort", "ImportanceDensity", "mix", "prior_normal"]

Array = NDArray[np.float64]

_CENTRES = 60
# Share of the final proposal that stays as wide as what is known beforehand.
DEFENSIVE_SHARE = 0.1
# Fewer effective draws than this are reported as a warning by the posterior.
FEWEST_EFFECTIVE = 500.0
# Steps of each draw: to part equal draws, and to mend a pool that is worth few draws.
_STEPS, _MENDING_STEPS = 3, 20
# Factors on the length of a step that is best for a normal.
_STEP_FACTORS = (0.3, 0.7, 1.0)


@dataclass(frozen=True)
class Effort:
    """How much work a density is worth.

    Attributes:
        pool: weighted draws that normaliser and samples come from.
        draws: draws of one round of adaptation.
        rounds: rounds of adaptation at most.
        effective: adaptation tempers the target until this many draws carry weight.
        good_share: adaptation ends when this share of an untempered round's draws carries weight.
    """

    pool: int = 20_000
    draws: int = 4000
    rounds: int = 8
    effective: float = 300.0
    good_share: float = 0.3


@dataclass(frozen=True)
class ImportanceDensity:
    """A normalised density over the prior's coordinates, zero outside the prior's bounds.

    Attributes:
        log_target: the log density up to a constant; takes points inside the bounds, shape (n, p).
        prior: the prior whose bounds apply.
        log_normaliser: log of the integral of the target.
        pool: draws of the proposal, shape (m, p).
        pool_weights: importance weights of the draws, sum 1, shape (m,).
        pool_heights: log target of the draws, shape (m,).
        weigh: a quicker `log_target`, exact enough for the weights of draws.
        mixtures: the mixtures that the target is made of, if it is made of some.
    """

    log_target: Callable[[Array], Array]
    prior: Prior
    log_normaliser: float
    pool: Array
    pool_weights: Array
    pool_heights: Array
    weigh: Callable[[Array], Array]
    mixtures: tuple[Mixture, ...] = ()

    @classmethod
    def of(
        cls,
        prior: Prior,
        log_target: Callable[[Array], Array],
        start: Mixture,
        wide: Mixture,
        *,
        seed: int = 0,
        effort: Effort | None = None,
        weigh: Callable[[Array], Array] | None = None,
        mixtures: tuple[Mixture, ...] = (),
    ) -> "ImportanceDensity":
        """Returns the normalised density.

        Args:
            prior: the prior whose bounds apply.
            log_target: the log density up to a constant inside the bounds.
            start: first proposal.
            wide: what a share of every later proposal stays as wide as.
            seed: seed of the draws.
            effort: number of draws.
            weigh: a quicker `log_target`; None: the same.
            mixtures: kept with the result.
        """
        effort, weigh = effort or Effort(), weigh or log_target
        generator = np.random.default_rng(seed)
        proposal = start

        pool, heights = np.empty((0, start.dimension)), np.empty(0)
        for _ in range(effort.rounds):
            draws = proposal.sample(effort.draws, generator)
            found = _inside(prior, weigh, draws)
            log_ratio = found - proposal.log_prob(draws, quick=True)
            if _effective(_normalised(log_ratio)) > effort.good_share * len(draws):
                # A round whose proposal is kept is the beginning of the pool.
                pool, heights = draws, found
                break
            weights = _tempered_weights(log_ratio, effort.effective)
            proposal = mix(kernel_estimate(draws, weights, generator), wide, DEFENSIVE_SHARE)
        rest = proposal.sample(effort.pool - len(pool), generator)
        pool = np.concatenate([pool, rest])
        heights = np.concatenate([heights, _inside(prior, weigh, rest)])
        log_ratio = heights - proposal.log_prob(pool, quick=True)
        largest = float(log_ratio.max())
        log_normaliser = largest + math.log(float(np.mean(np.exp(log_ratio - largest))))
        return cls(
            log_target,
            prior,
            log_normaliser,
            pool,
            _normalised(log_ratio),
            heights,
            weigh,
            mixtures,
        )

    @classmethod
    def of_prior_draws(
        cls,
        prior: Prior,
        log_target: Callable[[Array], Array],
        draws: Array,
        log_likelihood: Array,
        *,
        weigh: Callable[[Array], Array] | None = None,
        mixtures: tuple[Mixture, ...] = (),
    ) -> "ImportanceDensity":
        """Returns the density whose pool are draws of the prior.

        Args:
            prior: the prior.
            log_target: the log density up to a constant: likelihood times prior.
            draws: of the prior, shape (m, p).
            log_likelihood: at the draws, shape (m,).
            weigh: a quicker `log_target`; None: the same.
            mixtures: kept with the result.
        """
        largest = float(log_likelihood.max())
        log_normaliser = largest + math.log(float(np.mean(np.exp(log_likelihood - largest))))
        heights = log_likelihood + prior.coordinate_log_prob(draws)
        weights = _normalised(log_likelihood)
        weigh = weigh or log_target
        return cls(log_target, prior, log_normaliser, draws, weights, heights, weigh, mixtures)

    @property
    def effective_sample_size(self) -> float:
        """Number of independent draws that the weighted pool is worth."""
        return _effective(self.pool_weights)

    def log_prob(self, u: Array) -> Array:
        """Returns the log density at `u` (n, p), shape (n,); -inf outside the bounds."""
        return _inside(self.prior, self.log_target, u) - self.log_normaliser

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` draws by importance resampling and Metropolis steps, shape (n, p)."""
        size, dimension = self.pool.shape
        few = self.effective_sample_size < FEWEST_EFFECTIVE
        steps = _MENDING_STEPS if few else _STEPS
        # The first of each are the draws; between pairs of the others go the steps.
        chosen = generator.choice(size, size=(2 * steps + 1, n), p=self.pool_weights)
        draws, heights = self.pool[chosen[0]], self.pool_heights[chosen[0]]
        best = 2.38 / math.sqrt(2 * dimension)
        for first, second in zip(chosen[1::2], chosen[2::2], strict=True):
            length = best * generator.choice(_STEP_FACTORS, size=(n, 1))
            tried = draws + length * (self.pool[first] - self.pool[second])
            height = _inside(self.prior, self.weigh, tried)
            taken = np.log(generator.random(n)) < height - heights
            draws = np.where(taken[:, None], tried, draws)
            heights = np.where(taken, height, heights)
        return draws


def mix(narrow: Mixture, wide: Mixture, wide_share: float) -> Mixture:
    """Returns the mixture of two mixtures, the second with `wide_share` of the weight."""
    return Mixture(
        np.concatenate([(1 - wide_share) * narrow.weights, wide_share * wide.weights]),
        np.concatenate([narrow.means, wide.means]),
        np.concatenate([narrow.factors, wide.factors]),
    )


@lru_cache(maxsize=4)
def prior_normal(prior: Prior) -> Mixture:
    """Normal with the prior's mean and covariance: some draws are always inside the bounds."""
    draws = prior.to_unconstrained(prior.sample(1000, seed=0))
    covariance = np.diag(draws.var(axis=0))
    return Mixture.from_covariances(np.ones(1), draws.mean(axis=0)[None], covariance[None])


def kernel_estimate(draws: Array, weights: Array, generator: np.random.Generator) -> Mixture:
    """Mixture of equal normals around some of the weighted draws, with their total covariance."""
    dimension = draws.shape[1]
    centre = weights @ draws
    covariance = (draws - centre).T @ (weights[:, None] * (draws - centre))
    covariance += 1e-12 * np.trace(covariance) * np.eye(dimension) + 1e-18 * np.eye(dimension)
    # Silverman's rule for a normal of this dimension.
    width = (4 / ((dimension + 2) * _CENTRES)) ** (1 / (dimension + 4))
    chosen = draws[generator.choice(len(draws), size=_CENTRES, p=weights)]
    factor = np.linalg.cholesky(np.linalg.inv(width**2 * covariance))
    return Mixture(
        np.full(_CENTRES, 1 / _CENTRES), chosen, np.repeat(factor[None], _CENTRES, axis=0)
    )


def _inside(prior: Prior, log_target: Callable[[Array], Array], u: Array) -> Array:
    inside = is_inside(prior, u)
    result = np.full(len(u), -np.inf)
    if inside.any():
        result[inside] = log_target(u[inside])
    return result


def _tempered_weights(log_ratio: Array, effective: float) -> Array:
    power = 1.0
    while power > 1e-3:
        weights = _normalised(power * log_ratio)
        if _effective(weights) >= effective:
            return weights
        power *= 0.7
    return _normalised(power * log_ratio)


def _normalised(log_weights: Array) -> Array:
    largest = log_weights.max()
    if not np.isfinite(largest):
        return np.full(len(log_weights), 1 / len(log_weights))
    weights = np.exp(log_weights - largest)
    return weights / weights.sum()


def _effective(weights: Array) -> float:
    return float(1 / np.sum(weights**2))
