r"""What a fitted model says of a condition that was not measured, with what the fit leaves open.

Parameters and strengths are drawn from the normal of the fit,
$w \sim N(\hat w, (J^T V^{-1} J + \Lambda)^{-1})$, strengths held within their priors; one pour of
each draw, so that the spread is that of parameters and of pours together.
"""

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.closed import Closed
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.scenes import faults_of, scene_of
from granulcal.loop.surrogate.fit_draws import draw
from granulcal.loop.task import Condition
from granulcal.loop.test.trace import Explanation

__all__ = ["predict"]

Array = NDArray[np.float64]

# Seeds of pours, apart from those of the archive and of the replicates.
_SEED = 8_000_009


def predict(
    closed: Closed, condition: Condition, one: Explanation, forward: Forward, *, draws: int = 10
) -> tuple[Array, Array]:
    """Returns statistics under a condition, each (n, s): at the fit, and of draws around it.

    Args:
        closed: the closed loop.
        condition: the numbers of the scene; its recordings are not read.
        one: the base model or an explanation of `closed.trace`.
        forward: runs and keeps the pours.
        draws: pours of each kind.
    """
    trace = closed.trace
    design = trace.local.surrogate.design
    seeds = [_SEED + i for i in range(draws)]
    coarse = closed.task.coarse
    at_fit = forward.limit(closed.scene(condition, one), seeds, closed.faults(one), coarse)
    rows = []
    for seed, theta, psi in zip(
        seeds, *draw(trace.fit_of(one), design, draws, seed=_SEED), strict=True
    ):
        strengths = dict(zip(one.effects, psi, strict=True))
        scene = scene_of(closed.task, condition, theta, strengths)
        rows.append(forward.limit(scene, [seed], faults_of(closed.task, strengths), coarse))
    return at_fit, np.concatenate(rows)
