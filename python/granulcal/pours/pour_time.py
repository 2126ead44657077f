"""How long a pour takes on this machine."""

import time
from collections.abc import Sequence

import numpy as np

from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior

__all__ = ["in_the_middle", "pour_time"]

_SEED = 6_000_011


def pour_time(scenes: Sequence[Scene]) -> float:
    """Returns the mean time of one pour of each scene [s], one after another."""
    started = time.monotonic()
    for scene in scenes:
        simulate(scene, seed=_SEED)
    return (time.monotonic() - started) / len(scenes)


def in_the_middle(scene: Scene, prior: Prior) -> Scene:
    """Returns the scene with every parameter at the median of its prior."""
    medians = {one.path: float(one.quantile(np.array([0.5]))[0]) for one in prior.free}
    return scene.with_({**prior.fixed, **medians})
