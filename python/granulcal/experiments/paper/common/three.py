"""Pours of which all three parameters are unknown: experiments 5 to 9 share them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Pairs, Workshop
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["VARIANTS", "Variant", "estimate", "in_ln", "sets", "training_and_tests"]

Array = NDArray[np.float64]

_DRAWS = 4000
_ROLLING = 1


@dataclass(frozen=True)
class Variant:
    """A prior and solver settings.

    Attributes:
        name: of its pours and model.
        title: what it is.
        prior: what is drawn.
        preset: of the solver.
        seed: of the training pours; the tests have the next.
    """

    name: str
    title: str
    prior: Prior
    preset: str
    seed: int

    def scene(self, size: Size) -> Scene:
        """Returns the pour."""
        return size.scene().with_(preset=self.preset)


VARIANTS = (
    Variant("default", "default prior", Prior.default(), "default", 501),
    Variant("paper-prior", "the paper's prior", Prior.paper(), "default", 511),
    Variant("paper-solver", "the paper's prior and solver", Prior.paper(), "paper", 521),
)
"""The first is this project's; the others are nearer and nearer to the paper's set-up."""


def sets(size: Size, variant: Variant) -> list[PouredSet]:
    """Returns what `training_and_tests` pours."""
    counts = {"training": size.training, "tests": size.tests}
    scene = variant.scene(size)
    return [PouredSet(f"{variant.name}-{part}", count, scene) for part, count in counts.items()]


def training_and_tests(workshop: Workshop, variant: Variant) -> tuple[Pairs, Pairs]:
    """Returns the training pours of a variant, and tests drawn from the same prior."""
    size, name = workshop.size, variant.name
    scene = variant.scene(size)
    training = workshop.pairs(f"{name}-training", scene, variant.prior, size.training, variant.seed)
    tests = workshop.tests(f"{name}-tests", scene, variant.prior, size.tests, variant.seed + 1)
    return training, tests


def estimate(posterior: Posterior) -> Array:
    """Returns the mean of the posterior in its coordinates, in own units, shape (p,).

    A log-uniform parameter's mean is that of its logarithm.
    """
    draws = posterior.prior.to_unconstrained(posterior.sample(_DRAWS))
    return posterior.prior.from_unconstrained(draws.mean(axis=0)[None])[0]


def in_ln(theta: Array) -> Array:
    """Returns parameters (n, 3) with the logarithm of the rolling friction."""
    warped = np.array(theta, float)
    warped[:, _ROLLING] = np.log(warped[:, _ROLLING])
    return warped
