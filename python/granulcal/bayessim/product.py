r"""Posterior of several pours of one material, by importance sampling.

Given theta the pours are independent, so

$$ p(u | x_1, ..., x_k) \propto p(u)^{1 - k} \prod_i p(u | x_i) $$

with the trained posterior in place of each $p(u | x_i)$. The product of k mixtures has too many
components to write down, so it is evaluated point by point; its normaliser and its draws come from
weighted draws of a proposal that is adapted to it.

Reference:
    Cappe, Guillin, Marin and Robert, Population Monte Carlo, JCGS 13, 2004.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.density import TruncatedMixture
from granulcal.bayessim.mixture import Mixture
from granulcal.prior import Prior

__all__ = ["ProductDensity"]

Array = NDArray[np.float64]

_POOL = 20_000
_ADAPTING_DRAWS = 4000
_ADAPTING_ROUNDS = 8
_CENTRES = 60
# Adaptation tempers the target until this many draws carry weight.
_ADAPTING_EFFECTIVE = 300.0
# Adaptation ends when this share of an untempered round's draws carries weight.
_GOOD_SHARE = 0.3
# Share of the final proposal that stays as wide as the single posteriors.
_DEFENSIVE_SHARE = 0.1
# Fewer effective draws than this are reported as a warning by the posterior.
FEWEST_EFFECTIVE = 500.0
# Odds of 20 to 1 against one shared material are reported as a warning by the posterior.
LEAST_LOG_EVIDENCE_RATIO = -math.log(20.0)


@dataclass(frozen=True)
class ProductDensity:
    """Product of truncated posteriors over prior^(k - 1), normalised.

    Attributes:
        prior: the prior.
        factors: posterior of each pour alone.
        log_normaliser: log of the integral of the unnormalised product; this is also the log
            evidence of one shared theta against an independent theta for each pour.
        pool: draws of the proposal, shape (m, p).
        pool_weights: importance weights of the draws, sum 1, shape (m,).
    """

    prior: Prior
    factors: tuple[TruncatedMixture, ...]
    log_normaliser: float
    pool: Array
    pool_weights: Array

    @classmethod
    def of(
        cls, prior: Prior, factors: list[TruncatedMixture], *, seed: int = 0
    ) -> "ProductDensity":
        """Returns the normalised product of at least two `factors`."""
        generator = np.random.default_rng(seed)
        singles = Mixture.pooled([factor.mixture for factor in factors])
        wide = _mix(singles, _prior_normal(prior), _DEFENSIVE_SHARE)
        proposal = _mix(_moment_product(prior, factors), wide, 0.5)
        for _ in range(_ADAPTING_ROUNDS):
            draws = proposal.sample(_ADAPTING_DRAWS, generator)
            log_ratio = _log_product(prior, factors, draws) - proposal.log_prob(draws)
            if _effective(_normalised(log_ratio)) > _GOOD_SHARE * len(draws):
                break
            weights = _tempered_weights(log_ratio)
            proposal = _mix(_kernel_estimate(draws, weights, generator), wide, _DEFENSIVE_SHARE)
        pool = proposal.sample(_POOL, generator)
        log_ratio = _log_product(prior, factors, pool) - proposal.log_prob(pool)
        log_normaliser = float(log_ratio.max()) + math.log(
            float(np.mean(np.exp(log_ratio - log_ratio.max())))
        )
        weights = _normalised(log_ratio)
        return cls(prior, tuple(factors), log_normaliser, pool, weights)

    @property
    def mixtures(self) -> tuple[Mixture, ...]:
        """The mixture of each pour alone."""
        return tuple(factor.mixture for factor in self.factors)

    @property
    def effective_sample_size(self) -> float:
        """Number of independent draws that the weighted pool is worth."""
        return _effective(self.pool_weights)

    def log_prob(self, u: Array) -> Array:
        """Returns the log density at `u` (n, p), shape (n,); -inf outside the bounds."""
        return _log_product(self.prior, list(self.factors), u) - self.log_normaliser

    def sample(self, n: int, generator: np.random.Generator) -> Array:
        """Returns `n` draws by importance resampling, shape (n, p); a draw may repeat."""
        return self.pool[generator.choice(len(self.pool), size=n, p=self.pool_weights)]


def _log_product(prior: Prior, factors: list[TruncatedMixture], u: Array) -> Array:
    log_prior = prior.coordinate_log_prob(u)
    inside = np.isfinite(log_prior)
    result = np.full(len(u), -np.inf)
    total = sum(factor.log_prob(u[inside]) for factor in factors)
    result[inside] = total - (len(factors) - 1) * log_prior[inside]
    return result


def _moment_product(prior: Prior, factors: list[TruncatedMixture]) -> Mixture:
    """Product of one normal for each factor, over the prior's normals, made a little wider."""
    dimension = factors[0].mixture.dimension
    precision = np.zeros((dimension, dimension))
    information = np.zeros(dimension)
    for factor in factors:
        weights, means = factor.mixture.weights, factor.mixture.means
        centre = weights @ means
        inner = np.einsum("k,kij->ij", weights, factor.mixture.covariances)
        covariance = inner + (means - centre).T @ (weights[:, None] * (means - centre))
        precision += np.linalg.inv(covariance)
        information += np.linalg.solve(covariance, centre)
    normal = np.array([p.distribution == "normal" for p in prior.free], dtype=float)
    narrowed = precision - (len(factors) - 1) * np.diag(normal)
    # The prior's share can only be taken away while a proper density is left.
    if np.linalg.eigvalsh(narrowed).min() > 0.1 * np.linalg.eigvalsh(precision).min():
        precision = narrowed
    covariance = np.linalg.inv(precision)
    return Mixture.from_covariances(
        np.ones(1), (covariance @ information)[None], 1.5 * covariance[None]
    )


def _prior_normal(prior: Prior) -> Mixture:
    """Normal with the prior's mean and covariance: some draws are always inside the bounds."""
    draws = prior.to_unconstrained(prior.sample(1000, seed=0))
    covariance = np.diag(draws.var(axis=0))
    return Mixture.from_covariances(np.ones(1), draws.mean(axis=0)[None], covariance[None])


def _kernel_estimate(draws: Array, weights: Array, generator: np.random.Generator) -> Mixture:
    """Mixture of equal normals around some of the weighted draws, with their total covariance."""
    dimension = draws.shape[1]
    centre = weights @ draws
    covariance = (draws - centre).T @ (weights[:, None] * (draws - centre))
    covariance += 1e-12 * np.trace(covariance) * np.eye(dimension) + 1e-18 * np.eye(dimension)
    # Silverman's rule for a normal of this dimension.
    width = (4 / ((dimension + 2) * _CENTRES)) ** (1 / (dimension + 4))
    chosen = draws[generator.choice(len(draws), size=_CENTRES, p=weights)]
    kernels = np.repeat(width**2 * covariance[None], _CENTRES, axis=0)
    return Mixture.from_covariances(np.full(_CENTRES, 1 / _CENTRES), chosen, kernels)


def _mix(narrow: Mixture, wide: Mixture, wide_share: float) -> Mixture:
    return Mixture(
        np.concatenate([(1 - wide_share) * narrow.weights, wide_share * wide.weights]),
        np.concatenate([narrow.means, wide.means]),
        np.concatenate([narrow.factors, wide.factors]),
    )


def _tempered_weights(log_ratio: Array) -> Array:
    power = 1.0
    while power > 1e-3:
        weights = _normalised(power * log_ratio)
        if _effective(weights) >= _ADAPTING_EFFECTIVE:
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
