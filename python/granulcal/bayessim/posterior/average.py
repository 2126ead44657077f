r"""Which posterior of one pour to believe: the emulator's, the network's, or their average.

Two posteriors under one prior are averaged as log densities,

$$ \log p(u \mid x) = \log p(u) + a \log \frac{p_e(u \mid x)}{p(u)}
   + b \log \frac{p_n(u \mid x)}{p(u)} - \log Z(x; a, b) $$

With a = b = 1/2 the exponents of two normals are averaged, not the normals, so that the result is
no wider than the wider part (an average of two honest densities is too wide, Gneiting and Ranjan).
The prior is counted once, whatever a and b. On pairs $(u_n, x_n)$ that neither way has seen

$$ \max_a \frac1n \sum_n \log p(u_n \mid x_n) $$

with b = 1 - a is the likelihood of an exponential family with the difference of the two log ratios
as its statistic, hence concave; Newton's steps are exact, with its mean and variance over weighted
points. The average has to earn its place: it is taken only where its gain on the better one is
beyond the error of that gain (the one-standard-error rule of Breiman et al.). Both exponents free
(a + b above 1 sharpens) fitted fifty pairs well and others badly.

Reference:
    Breiman, Friedman, Olshen and Stone, Classification and regression trees, 1984, section 3.4.3.
    Genest and Zidek, Combining probability distributions, Statistical Science 1, 1986.
    Gneiting and Ranjan, Combining predictive distributions, Electronic Journal of Statistics 7,
    2013.
    Heskes, Selecting weighting factors in logarithmic opinion pools, NIPS 10, 1998.
    Veach and Guibas, Optimally combining sampling techniques for Monte Carlo rendering, SIGGRAPH
    1995 (points of the prior and of the network together).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.bayessim.emulator.likelihood import Fold
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.coordinates import coordinates_of

__all__ = ["Average", "HeldOut"]

Array = NDArray[np.float64]

FORMS = ("geometric", "arithmetic")
# An average of both is kept only if it gains so many standard errors on the better one.
_WORTHWHILE = 1.0
# With fewer held-out pairs the network is not taken, alone or in an average.
_FEWEST_TO_CHOOSE = 10
# An average in which one of both hardly counts is none.
_SMALLEST_WEIGHT = 0.02
_NEWTON_ROUNDS = 30
# Gain of a step [nat] below which the maximum is reached.
_SMALLEST_GAIN = 1e-6
# Draws of the network's posterior beside the cells of the prior.
_DRAWS = 1024
# Log likelihood of what is impossible: less is -inf, of which no share is a number.
_LOWEST = -1e6


@dataclass(frozen=True)
class Average:
    """How much the posteriors of emulator and network count.

    Attributes:
        emulator: exponent a of the emulator's; 0: the network alone.
        network: exponent b of the network's; 0: the emulator alone.
        form: `geometric`, or `arithmetic` of a model file of version 3, whose weights are those of
            a sum.
    """

    emulator: float
    network: float
    form: str = "geometric"

    @property
    def is_of_both(self) -> bool:
        """Whether it is an average at all."""
        return self.emulator > 0 and self.network > 0

    def __str__(self) -> str:
        """The weights in words."""
        parts = [("emulator", self.emulator), ("network", self.network)]
        named = [f"{name}^{weight:.2f}" for name, weight in parts if weight > 0]
        return " x ".join(named)


EMULATOR_ALONE, NETWORK_ALONE = Average(1.0, 0.0), Average(0.0, 1.0)


@dataclass(frozen=True)
class HeldOut:
    """Log ratios of both posteriors to the prior for pairs that neither has seen.

    Attributes:
        at_truth: emulator's and network's at the true coordinates up to a constant, shape (n, 2).
        at_points: the same at other points, shape (n, m, 2).
        log_weights: log of prior over density of these points, shape (n, m).
        log_prior: log prior density at the truth, shape (n,).
    """

    at_truth: Array
    at_points: Array
    log_weights: Array
    log_prior: Array

    @classmethod
    def of(
        cls, fold: Fold, mixtures: list[Mixture], u: Array, z: Array, *, seed: int = 0
    ) -> "HeldOut":
        """Returns the log ratios of pairs that a fold leaves out.

        Args:
            fold: an emulator that has not seen the pairs.
            mixtures: the network's, over coordinates, one for each pair.
            u: true coordinates, shape (n, p).
            z: standardised statistics, shape (n, s).
            seed: seed of the draws.
        """
        likelihood = fold.likelihood
        prior, cells = likelihood.prior, likelihood.cells
        log_prior = prior.coordinate_log_prob(u)
        network = (NETWORK_ALONE.form, NETWORK_ALONE.emulator, NETWORK_ALONE.network)
        found: list[tuple[Array, Array, Array]] = []
        for mixture, truth, row in zip(mixtures, u, z[:, None], strict=True):
            cut = _native.Posterior(coordinates_of(prior), [], [mixture.arrays], network)
            # The truth is one of the points, so that it cannot be more probable than all.
            others = np.concatenate([cut.sample(_DRAWS, seed), truth[None]])
            points = np.concatenate([cells, others])
            # The cells are the first points of the pool.
            at_cells = likelihood.at_pool(row)[: len(cells)]
            emulated = np.concatenate([at_cells, likelihood.log_prob(row, others)])
            learnt = cut.log_prob(points) - prior.coordinate_log_prob(points)
            share = _DRAWS / (_DRAWS + len(cells))
            log_weights = -np.logaddexp(math.log(1 - share), math.log(share) + learnt)
            # Far out in an unbounded prior the likelihood is 0.
            ratios = np.maximum(np.column_stack([emulated, learnt]), _LOWEST)
            found.append((ratios[-1], ratios, log_weights))
        at_truth, at_points, log_weights = (np.stack(part) for part in zip(*found, strict=True))
        return cls(at_truth, at_points, log_weights, log_prior)

    @classmethod
    def joined(cls, parts: "list[HeldOut]") -> "HeldOut":
        """Returns the pairs of several folds."""
        return cls(
            np.concatenate([part.at_truth for part in parts]),
            np.concatenate([part.at_points for part in parts]),
            np.concatenate([part.log_weights for part in parts]),
            np.concatenate([part.log_prior for part in parts]),
        )

    def scores(self, average: Average) -> Array:
        """Returns log densities of the truths under the geometric average, shape (n,)."""
        return self._scores(np.array([average.emulator, average.network]))

    def gain(self, average: Average) -> float:
        """Returns by how much the truths are more probable than by the prior, their mean [nat]."""
        return float((self.scores(average) - self.log_prior).mean())

    def choose(self) -> Average:
        """Returns the average that says most, one alone where more is not worth it."""
        if len(self.at_truth) < _FEWEST_TO_CHOOSE:
            # So few say nothing of the network, and the emulator is checked on every pair.
            return EMULATOR_ALONE
        alone = self.scores(EMULATOR_ALONE), self.scores(NETWORK_ALONE)
        is_emulator = bool(np.mean(alone[0]) >= np.mean(alone[1]))
        best = EMULATOR_ALONE if is_emulator else NETWORK_ALONE
        share = round(self._most_probable_share(), 3)
        found = Average(share, round(1 - share, 3))
        gains = self.scores(found) - self.scores(best)
        is_average = min(found.emulator, found.network) >= _SMALLEST_WEIGHT
        is_worth_it = np.mean(gains) > _WORTHWHILE * np.std(gains) / math.sqrt(len(gains))
        return found if is_average and is_worth_it else best

    def _most_probable_share(self) -> float:
        """Newton's method for the emulator's share a, the network's being 1 - a."""
        share, direction = 0.5, np.array([1.0, -1.0])
        score = float(self._scores(np.array([share, 1 - share])).mean())
        for _ in range(_NEWTON_ROUNDS):
            mean, variance = self._moments(np.array([share, 1 - share]), direction)
            slope = float((self.at_truth @ direction - mean).mean())
            step = slope / max(float(variance.mean()), 1e-12)
            # No further than to one of both alone.
            step = float(np.clip(share + step, 0.0, 1.0)) - share
            while abs(step) > 1e-6:
                tried = share + step
                found = float(self._scores(np.array([tried, 1 - tried])).mean())
                if found > score:
                    break
                step *= 0.5
            else:
                return share
            gain, share, score = found - score, tried, found
            if gain < _SMALLEST_GAIN:
                break
        return share

    def _tilted(self, weights: Array) -> tuple[Array, Array]:
        """Log weights of the points under the average, and their largest, (n, m) and (n, 1)."""
        logs = self.log_weights + self.at_points @ weights
        return logs, logs.max(axis=1, keepdims=True)

    def _scores(self, weights: Array) -> Array:
        logs, largest = self._tilted(weights)
        log_normaliser = largest[:, 0] + np.log(np.exp(logs - largest).mean(axis=1))
        return self.log_prior + self.at_truth @ weights - log_normaliser

    def _moments(self, weights: Array, direction: Array) -> tuple[Array, Array]:
        """Mean and variance of the log ratios along a direction under the average, (n,) each."""
        logs, largest = self._tilted(weights)
        shares = np.exp(logs - largest)
        shares /= shares.sum(axis=1, keepdims=True)
        along = self.at_points @ direction
        mean = np.sum(shares * along, axis=1)
        return mean, np.sum(shares * (along - mean[:, None]) ** 2, axis=1)
