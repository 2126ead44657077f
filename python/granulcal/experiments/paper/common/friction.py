"""Pours of which only the sliding friction is unknown, each seen through several cameras at once.

Experiments 2 and 3 share them: one pour serves every error of observation.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.paper.common.eye import Disturbance, Eye
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Pairs, Workshop
from granulcal.pours.left_out import LeftOut
from granulcal.pours.statistics import NAMES
from granulcal.prior import Parameter, Prior

__all__ = ["BLURS", "NOISES", "PRIOR", "even_tests", "sets", "tests", "training", "view"]

Array = NDArray[np.float64]

BLURS = (2.0, 4.0, 6.0, 8.0)
"""The paper's blurs [px]."""
NOISES = (1e-3, 2e-3, 3e-3, 4e-3)
"""The paper's depth noises [m]."""
PRIOR = Prior(
    [Parameter(path="material.sliding_friction", distribution="uniform", low=0.01, high=1.0)]
)
"""The paper's range of the sliding friction."""

_TRAINING_SEED, _TEST_SEED, _EVEN_SEED = 201, 202, 203


def _test_views() -> dict[str, Disturbance]:
    views = {"clean": Disturbance(), "d435": Disturbance(is_d435=True)}
    views |= {f"blur {s:g}": Disturbance(blur=s) for s in BLURS}
    views |= {f"fine blur {s:g}": Disturbance(fine_blur=s) for s in BLURS}
    return views | {f"noise {1e3 * s:g}": Disturbance(depth_noise=s) for s in NOISES}


def _mixed(seed: int) -> Disturbance:
    """A blur or a depth noise of any level up to the paper's largest, one or the other."""
    random = np.random.default_rng([seed, _TRAINING_SEED])
    level = random.random()
    if random.random() < 0.5:
        return Disturbance(blur=level * BLURS[-1])
    return Disturbance(depth_noise=level * NOISES[-1])


_TRAINING_VIEWS = {
    "clean": Disturbance(),
    "d435": Disturbance(is_d435=True),
    "mixed": _mixed,
}


def sets(size: Size, kind: str) -> list[PouredSet]:
    """Returns what `training` pours and the tests: `tests`, or `even` for `even_tests`."""
    scene = size.scene()
    return [
        PouredSet("friction-training", size.training, scene),
        PouredSet(f"friction-{kind}", size.tests, scene),
    ]


def training(workshop: Workshop) -> Pairs:
    """Returns the training pours with every view of theirs, named `VIEW/STATISTIC`."""
    theta = PRIOR.sample(workshop.size.training, _TRAINING_SEED)
    return _seen(workshop, "friction-training", theta, _TRAINING_SEED, _TRAINING_VIEWS)


def tests(workshop: Workshop) -> Pairs:
    """Returns usable test pours of independent draws, undisturbed, as many as were asked for."""
    views = {"clean": Disturbance()}

    def pour(count: int) -> Pairs:
        theta = PRIOR.sample(count, _TEST_SEED)
        return _seen(workshop, "friction-tests", theta, _TEST_SEED, views)

    return view(workshop.enough(workshop.size.tests, pour), "clean")


def even_tests(workshop: Workshop) -> Pairs:
    """Returns the test pours of evenly spaced sliding friction, in rising order, every view."""
    low, high = PRIOR.bounds[0]
    theta = np.linspace(low, high, workshop.size.tests)[:, None]
    return _seen(workshop, "friction-even", theta, _EVEN_SEED, _test_views())


def view(pairs: Pairs, name: str) -> Pairs:
    """Returns the pairs as one view shows them."""
    found = pairs.of([f"{name}/{statistic}" for statistic in NAMES])
    return Pairs(found.theta, found.x, found.prior, NAMES, found.unusable)


def _seen(workshop: Workshop, name: str, theta: Array, seed: int, views: Mapping) -> Pairs:
    scene = workshop.size.scene()
    look = Eye.of(scene).look(views)
    x = workshop.poured(name, scene, PRIOR, theta, seed=seed, look=look)
    kept = np.isfinite(x).all(axis=1)
    return Pairs(theta[kept], x[kept], PRIOR, look[0], LeftOut(unseen=int((~kept).sum())))
