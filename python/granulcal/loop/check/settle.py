r"""Pours of the models at their fits, again and again until the surrogate is right there.

    repeat
        pour the base model and the verdict's at their fits, with fresh seeds
        p <- are these pours where the surrogate says?                        (confirm.py)
        stop if p > `confirm`, or after `ANCHORS` anchors
        hold the surrogate at a fit by these pours                            (anchor.py):
            the base model's, if this is the first round and it is wrong there; else the verdict's
        ask everything again

A surrogate is worst where it stands at the edge of its archive, and there fits are led astray. Each
round's pours test the anchor of the round before, which has not seen them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.confirm import confirm
from granulcal.loop.pours.replicates import FEWEST, ModelPours, both
from granulcal.loop.surrogate.anchor import Anchor
from granulcal.loop.surrogate.baseline import Fit, Start
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.trace import Trace, trace

__all__ = ["ANCHORS", "Settled", "anchored", "settle"]

Array = NDArray[np.float64]

ANCHORS = 3
"""Most rounds of pours that move the surrogate."""
# Seeds of a round's pours, apart from those of the round before.
_ROUND_STEP = 1000


@dataclass(frozen=True)
class Settled:
    """What is known once the surrogate has been held.

    Attributes:
        trace: what the surrogate says that is held.
        surrogate: that surrogate.
        simulated: pours of both models at their fits, by name of the condition to fit.
        confirmed: p of these pours; NaN where too few are usable.
        anchors: how often the surrogate was moved.
        seed: of the pours.
        before: pours of the rounds before the last.
    """

    trace: Trace
    surrogate: Surrogate
    simulated: dict[str, ModelPours]
    confirmed: float
    anchors: int
    seed: int
    before: int


def settle(
    analysis: Analysis, surrogate: Surrogate, found: Trace, observed: Sequence[ConditionPours]
) -> Settled:
    """Returns the trace, by a surrogate that is right at its fits if pours can make it so."""
    rules, say, before, number = analysis.rules, analysis.say, 0, 0
    while True:
        own = analysis.seed + _ROUND_STEP * number
        simulated = {
            c.name: both(analysis.forward, analysis.task, c, found, own) for c in analysis.fitted
        }
        of_base = _usable(analysis, {name: two.base for name, two in simulated.items()})
        of_best = _usable(analysis, {name: two.augmented for name, two in simulated.items()})
        fit = found.fit_of(found.best)
        right = confirm(surrogate, fit, of_best) if of_best else float("nan")
        say(
            f"fresh pours of the verdict's model: the surrogate is right there with p = {right:.3g}"
        )
        if number == ANCHORS or not of_base or not right <= rules.confirm:
            return Settled(found, surrogate, simulated, right, number, own, before)
        # What is wrong without effects is wrong with them: all models start from the base's mean.
        # Where holding it there has not mended the verdict's model, that one's turn comes.
        base, is_first = found.base_fit, number == 0
        if fit is base or (is_first and confirm(surrogate, base, of_base) <= rules.confirm):
            surrogate = anchored(surrogate, base, of_base)
        else:
            surrogate = anchored(surrogate, fit, of_best)
        before += sum(two.pours for two in simulated.values())
        number += 1
        start = Start(fit.v, fit.psi)
        found = trace(surrogate, observed, rules, seed=analysis.seed, starts=(start,))
        say(f"held by these pours, {found.verdict.kind}: {found.verdict.reason}")


def anchored(surrogate: Surrogate, fit: Fit, fresh: Sequence[ConditionPours]) -> Surrogate:
    """Returns the surrogate held at a fit by fresh pours there; an older anchor is gone."""
    plain = replace(surrogate, anchor=None)
    stack = StackedMeans.of(plain, fresh)
    local = LinearisedSurrogate.at(plain, stack.conditions, stack.counts, fit.v)
    count, size = stack.means.shape
    noise = local.pour_covariance(fit.v, fit.psi).reshape(count, size, count, size)
    anchor = Anchor(
        conditions=stack.conditions,
        gaps=stack.means - local.mean(fit.v, fit.psi).reshape(count, size),
        covariances=noise[range(count), :, range(count), :],
    )
    return replace(plain, anchor=anchor)


def _usable(analysis: Analysis, rows: dict[str, Array]) -> list[ConditionPours]:
    """Pours under the conditions where there are enough of them."""
    return [analysis.pours(c, rows[c.name]) for c in analysis.fitted if len(rows[c.name]) >= FEWEST]
