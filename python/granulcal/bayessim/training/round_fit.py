"""The emulator after one round, and where the next round pours."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.bayessim.check.misfit import MisfitReference
from granulcal.bayessim.emulator.likelihood import EmulatorChoice, Fold, Likelihood
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.posterior.doubts import out_of_range
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.prior import Prior

__all__ = ["RoundFit", "first_design"]

Array = NDArray[np.float64]

_PRIOR_SHARE = 0.1
_CANDIDATES = 2
_FEATURES = 100


@dataclass(frozen=True)
class RoundFit:
    """The emulator of the pours so far, and what it says of the observation.

    Attributes:
        prior: the prior.
        u: coordinates of the usable pours, shape (n, p).
        z: their standardised statistics, shape (n, s).
        observed: the observation, standardised, shape (k, s).
        standardiser: of the statistics.
        likelihood: the emulator.
        folds: the same without some pours each.
        choice: what held-out pours say of it.
        posterior: of the parameters.
    """

    prior: Prior
    u: Array
    z: Array
    observed: Array
    standardiser: Standardiser
    likelihood: Likelihood
    folds: list[Fold]
    choice: EmulatorChoice
    posterior: Posterior

    @classmethod
    def of(
        cls, prior: Prior, u: Array, x: Array, x_obs: Array, names: Sequence[str], seed: int
    ) -> "RoundFit":
        """Returns the emulator of pours at `u` (n, p) and the posterior given `x_obs` (k, s).

        Args:
            prior: the prior.
            u: coordinates, shape (n, p).
            x: their statistics, own units, shape (n, s).
            x_obs: the observation, own units, shape (k, s).
            names: of the statistics.
            seed: of every random choice.
        """
        standardiser = Standardiser.fit(x)
        z = standardiser.apply(x)
        likelihood, folds, choice = Likelihood.fit(u, z, prior, features=_FEATURES, seed=seed)
        observed = standardiser.apply(x_obs)
        warnings = out_of_range(standardiser, x_obs, names)
        posterior = Posterior.from_conditions(prior, [(likelihood, observed)], warnings=warnings)
        return cls(prior, u, z, observed, standardiser, likelihood, folds, choice, posterior)

    def reference(self) -> MisfitReference:
        """Returns what an observation of a right model leaves at its fit."""
        return MisfitReference.of(self.folds, self.u, self.z)

    def next(self, taken: Array, count: int, seed: int, power: float) -> Array:
        """Returns coordinates of the next pours, shape (count, p), away from those `taken` (n, p).

        Args:
            taken: coordinates of all pours so far.
            count: pours of the round.
            seed: seed of the draws.
            power: of the likelihood that they are drawn by.
        """
        generator = np.random.default_rng(seed)
        pool = self.likelihood.pool
        log_weights = power * self.likelihood.at_pool(self.observed)
        weights = np.exp(log_weights - log_weights.max()) + 1e-12
        blind = max(1, round(_PRIOR_SHARE * count))
        # Farthest of few: of many, and with the prior's among them, all would be of the tails.
        near = generator.choice(
            len(pool), size=_CANDIDATES * (count - blind), replace=False, p=weights / weights.sum()
        )
        candidates = pool[near]
        scale = np.maximum(candidates.std(axis=0), 1e-6)
        nearest = np.min(
            np.linalg.norm((candidates[:, None] - taken[None]) / scale, axis=2), axis=1
        )
        picked = []
        for _ in range(count - blind):
            best = int(nearest.argmax())
            picked.append(best)
            away = np.linalg.norm((candidates - candidates[best]) / scale, axis=1)
            nearest = np.minimum(nearest, away)
        anywhere = pool[generator.choice(len(pool), size=blind, replace=False)]
        return np.concatenate([candidates[picked], anywhere])


def first_design(prior: Prior, count: int, seed: int) -> Array:
    """Returns evenly spread draws of the prior, moved by the seed, coordinates (count, p)."""
    shift = np.random.default_rng(seed).random(len(prior.free))
    uniform = (_native.quasi_uniform(count, len(prior.free)) + shift) % 1
    columns = [p.quantile(uniform[:, i]) for i, p in enumerate(prior.free)]
    return prior.to_unconstrained(np.column_stack(columns))
