r"""Posteriors of one observation by two ways, averaged as densities.

$$ p(u \mid x) = \sum_i w_i p_i(u \mid x), \qquad
   w = \arg\max \frac1n \sum_n \log \sum_i w_i p_i(u_n \mid x_n) $$

over pairs that neither way has seen: where one is wrong with confidence the other holds the truth,
and the mean log density of the average is never below that of the better one by more than
$-\log w$. Emulator and network err for different reasons, so that the average may gain on both.
An average of two honest densities is too wide (Gneiting and Ranjan), so it has to earn its place:
it is kept only where its gain on the better one is beyond the error of that gain (the
one-standard-error rule of Breiman et al.).

Reference:
    Breiman, Friedman, Olshen and Stone, Classification and regression trees, 1984, section 3.4.3.
    Gneiting and Ranjan, Combining predictive distributions, Electronic Journal of Statistics 7,
    2013.
    Yao, Vehtari, Simpson and Gelman, Using stacking to average Bayesian predictive distributions,
    Bayesian Analysis 13, 2018.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.density import Density
from granulcal.bayessim.mixture import Mixture

__all__ = ["StackedDensity", "stacking_weight"]

Array = NDArray[np.float64]

_WEIGHTS = np.linspace(0, 1, 21)
# An average of both is kept only if it gains so many standard errors on the better one.
_WORTHWHILE = 1.0


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


def stacking_weight(first: Array, second: Array) -> float:
    """Returns the weight of the first density, 0 or 1 where an average is not worth it.

    Args:
        first: its log densities at the parameters of unseen pairs, shape (n,).
        second: those of the other, shape (n,).
    """
    with np.errstate(divide="ignore"):
        averages = [np.logaddexp(np.log(w) + first, np.log(1 - w) + second) for w in _WEIGHTS]
    best = int(np.argmax([np.mean(average) for average in averages]))
    better, alone = (first, 1.0) if np.mean(first) >= np.mean(second) else (second, 0.0)
    gains = averages[best] - better
    if np.mean(gains) <= _WORTHWHILE * np.std(gains) / np.sqrt(len(gains)):
        return alone
    return float(_WEIGHTS[best])
