r"""Further pours where the fits are, so that the surrogate is right at the models that matter.

An archive is spread over the whole prior and thin at any one place; where its error is as large as
what is left of a fit, a model seems adequate for want of pours. Once the residual test has
rejected, pours at

$$ w \sim N(\hat w, (J^T V^{-1} J + \Lambda)^{-1}) $$

of the base model and of the most probable ones, under the conditions to fit, join the archive's
rows, and everything is asked again of the new surrogate. A set without any effect has to be
rejected twice to be named: false alarms can only become fewer.

Reference:
    docs/theory/loop.md; sequential design at the posterior: Kandasamy et al., Query efficient
    posterior estimation in scientific experiments via Bayesian active learning, Artificial
    Intelligence 243, 2017.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.pours.rows import Rows
from granulcal.loop.pours.scenes import faults_of, scene_of
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.fit_draws import draw
from granulcal.loop.test.trace import Trace

__all__ = ["ROUND", "further"]

Array = NDArray[np.float64]

# Models besides the base one, and pours of each, in a round.
_MODELS, _EACH = 3, 24
ROUND = (1 + _MODELS) * _EACH
"""Most pours in a round."""
# Seeds of these pours, apart from those of the archive and of the replicates; of a round, a model.
_SEED, _ROUND_STEP, _MODEL_STEP = 9_500_021, 10_000, 100


def further(
    analysis: Analysis, found: Trace, number: int, beside: Sequence[Fit] | None = None
) -> list[Rows]:
    """Runs the pours of round `number`; those of effects on the camera's lengths need none.

    They are of the base model, and of the fits `beside` it or of the most probable models.
    """
    task, plan = analysis.task, analysis.plan
    free = {effect.name for effect in task.library if effect.camera}
    of_models = [model.fit for model in found.models] if beside is None else beside
    fits = [found.base_fit, *of_models]
    effects = [[plan.design.effects[k].name for k in fit.active] for fit in fits]
    asked = [(f, e) for f, e in zip(fits, effects, strict=True) if not free & set(e)]
    first = _SEED + analysis.seed + _ROUND_STEP * number
    made = []
    for i, (fit, names) in enumerate(asked[: 1 + _MODELS] if beside is None else asked):
        rows = _of_model(analysis, fit, names, first + _MODEL_STEP * i)
        if rows is not None:
            made.append(rows)
    return made


def _of_model(analysis: Analysis, fit: Fit, names: list[str], seed: int) -> Rows | None:
    task, plan, conditions = analysis.task, analysis.plan, analysis.fitted
    kept: list[Rows] = []
    for i, (theta, strengths) in enumerate(
        zip(*draw(fit, plan.design, _EACH, seed=seed), strict=True)
    ):
        condition = conditions[i % len(conditions)]
        own = dict(zip(names, strengths.tolist(), strict=True))
        scene = scene_of(task, condition, theta, own)
        found = analysis.forward.pours(scene, [seed + i], faults_of(task, own))
        if len(found):
            psi = np.zeros(len(plan.design.effects))
            psi[list(fit.active)] = strengths
            where = plan.unit(condition.at)
            kept.append(Rows(theta[None], where[None], psi[None], found[:1]))
    return Rows.joined(kept) if kept else None
