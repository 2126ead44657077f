"""A trained network with what comes before and after it: standardised statistics to a mixture."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.emulator.signal import SignalAxes
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.network.network import Network
from granulcal.bayessim.network.trainer import Progress, TrainingResult, train
from granulcal.bayessim.training.config import Config
from granulcal.prior import Prior

__all__ = ["Amortised"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Amortised:
    """Mixture over the prior's coordinates for any standardised statistics.

    Attributes:
        axes: rotation of the statistics; the network sees the first of them.
        network: the ensemble.
        shift: mean of the training coordinates, shape (p,).
        scale: standard deviation of the training coordinates, shape (p,).
    """

    axes: SignalAxes
    network: Network
    shift: Array
    scale: Array

    @classmethod
    def fit(
        cls,
        u: Array,
        z: Array,
        *,
        config: Config,
        seed: int,
        weights: Array | None = None,
        progress: Callable[[Progress], None] | None = None,
    ) -> tuple["Amortised", TrainingResult]:
        """Returns the network trained on pairs `u` (n, p), `z` (n, s), and how it went."""
        shift, scale = _moments(u)
        targets = (u - shift) / scale
        axes = SignalAxes.fit(targets, z) if config.snr else SignalAxes.identity(z.shape[1])
        result = train(
            targets,
            axes.apply(z),
            axes.relevance,
            config=config,
            seed=seed,
            weights=weights,
            progress=progress,
        )
        return cls(axes, result.network, shift, scale), result

    @classmethod
    def distil(
        cls,
        likelihood: Likelihood,
        prior: Prior,
        *,
        config: Config,
        seed: int,
        progress: Callable[[Progress], None] | None = None,
    ) -> tuple["Amortised", TrainingResult]:
        """Returns the network trained on draws of the prior and emulated statistics of them."""
        u = prior.to_unconstrained(prior.sample(config.synthetic, seed=seed))
        y = likelihood.simulate(u, np.random.default_rng((seed, 3)))
        axes = likelihood.axes.first(likelihood.axis_count)
        shift, scale = _moments(u)
        result = train(
            (u - shift) / scale, y, axes.relevance, config=config, seed=seed, progress=progress
        )
        return cls(axes, result.network, shift, scale), result

    def mixtures(self, z: Array) -> list[Mixture]:
        """Returns one mixture over coordinates for each row of `z` (n, s)."""
        return [
            Mixture(
                mixture.weights,
                self.shift + self.scale * mixture.means,
                mixture.factors / self.scale[:, None],
            )
            for mixture in self.network.mixtures(self.axes.apply(z))
        ]


def _moments(u: Array) -> tuple[Array, Array]:
    shift, scale = u.mean(axis=0), u.std(axis=0)
    return shift, np.where(scale > 0, scale, 1.0)
