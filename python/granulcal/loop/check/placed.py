r"""The verdict's model where its own pours put it.

A fit is where the surrogate is nearest to the data. The model's pours there say how far the true
optimum is: the step $\Delta$ of `recentre.py`. Fresh pours at $\hat w + \Delta$ ask whether it was
one to take: with S of that file and $r = \bar y - \bar x$, the model is where $r^T S^{-1} r$ is
smaller, and the pours there say anew how strong its effect is and whether they leave anything.
Errors at sealed conditions, predictions and parameters are those of the model there. The
base model stays at its fit, on which the correction without physics stands.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.checks import recentred
from granulcal.loop.check.recentre import Recentred, misfit, recentre
from granulcal.loop.effects.design import LARGEST_Z, cube_from_normal
from granulcal.loop.pours.replicates import FEWEST, ModelPours, pours_of
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.trace import Trace

__all__ = ["Placed", "placed"]

Array = NDArray[np.float64]

# Seeds of these pours, apart from those of the rounds that hold the surrogate.
_SEED = 5000


class Placed(NamedTuple):
    """Where the models are.

    Attributes:
        trace: whose verdict's model is where its pours put it.
        simulated: pours of both models under the conditions to fit, by name.
        of_base: what the base model's pours say of the data; None where too few are usable.
        own: the same of the verdict's model, where it is.
        pours: that were made for it.
        seed: of the pours of a step.
    """

    trace: Trace
    simulated: dict[str, ModelPours]
    of_base: Recentred | None
    own: Recentred | None
    pours: int
    seed: int


def placed(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
) -> Placed:
    """Returns the verdict's model at its fit or a step from it, whichever is nearer to the data.

    Args:
        analysis: task and pours.
        surrogate: whose slopes and noise are used.
        found: what the fits say.
        measured: statistics under each condition to fit, by name.
        simulated: pours of both models at their fits, the same way.
    """
    best, seed = found.best, analysis.seed + _SEED
    of_base = own = recentred(analysis, surrogate, found, found.base, measured, simulated)
    if best is not found.base:
        own = recentred(analysis, surrogate, found, best, measured, simulated)
    if own is None or best is found.base:
        return Placed(found, simulated, of_base, own, 0, seed)
    v = np.clip(own.v, -LARGEST_Z, LARGEST_Z)
    moved = replace(best, theta=cube_from_normal(v), best_strengths=own.strengths)
    fresh = {
        c.name: pours_of(analysis.forward, analysis.task, c, moved, seed) for c in analysis.fitted
    }
    same = Placed(found, simulated, of_base, own, sum(map(len, fresh.values())), seed)
    if min(map(len, fresh.values())) < FEWEST:
        return same

    fit = found.fit_of(best)
    seen, poured = analysis.observed(measured), analysis.observed(fresh)
    known = analysis.observed({name: two.augmented for name, two in simulated.items()})
    before = misfit(surrogate, fit, seen, known)
    after = misfit(surrogate, fit, seen, poured)
    analysis.say(f"the step of its own pours takes its misfit from {before:.3g} to {after:.3g}")
    if after >= before:
        return same
    explanations = tuple(moved if one is best else one for one in found.explanations)
    there = {name: ModelPours(two.base, fresh[name]) for name, two in simulated.items()}
    psi = fit.psi.copy()
    psi[list(fit.active)] = own.strengths
    there_fit = replace(fit, v=v, psi=psi)
    again = recentre(surrogate, there_fit, seen, poured, analysis.rules, seed=analysis.seed)
    # What is drawn from its fit, predictions among it, is drawn there.
    models = tuple(
        replace(model, fit=there_fit) if one is best else model
        for one, model in zip(found.explanations, found.models, strict=True)
    )
    moved_trace = replace(found, explanations=explanations, models=models)
    return same._replace(trace=moved_trace, simulated=there, own=again)
