r"""Pours of the models at their fits, again and again until the surrogate is right there.

    repeat
        pour the base model and the verdict's at their fits, with fresh seeds
        p <- are these pours where the surrogate says, of either?             (confirm.py)
        stop if both p > `confirm`, or after `ANCHORS` anchors
        hold the surrogate at both fits, at each by its own pours             (anchor.py)
        ask everything again

A surrogate is worst where it stands at the edge of its archive, and there fits are led astray. Each
round's pours test the anchor of the round before, which has not seen them. Both fits are held, for
the word weighs one against the other: a gap of the verdict's model that is taken for the base's
too speaks against a base where the surrogate is right.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.confirm import confirm
from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.pours.replicates import FEWEST, ModelPours, both
from granulcal.loop.surrogate.anchor import Anchor, Hold
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
        confirmed: p of the pours of the verdict's model; NaN where too few are usable.
        at_base: p of those of the base model, that of the verdict's where it is the same.
        anchors: how often the surrogate was moved.
        seed: of the pours.
        before: pours of the rounds before the last.
    """

    trace: Trace
    surrogate: Surrogate
    simulated: dict[str, ModelPours]
    confirmed: float
    at_base: float
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
        fit, base = found.fit_of(found.best), found.base_fit
        right = confirm(surrogate, fit, of_best) if of_best else float("nan")
        at_base, where = right, f"p = {right:.3g} there"
        if fit is not base and of_base:
            at_base = confirm(surrogate, base, of_base)
            where += f", p = {at_base:.3g} at the base model's fit"
        say(f"fresh pours of the verdict's model: the surrogate is right with {where}")
        is_wrong = right <= rules.confirm or at_base <= rules.confirm
        if number == ANCHORS or not of_base or not of_best or not is_wrong:
            return Settled(found, surrogate, simulated, right, at_base, number, own, before)
        fits = [(base, of_base)] if fit is base else [(base, of_base), (fit, of_best)]
        surrogate = anchored(surrogate, fits)
        before += sum(two.pours for two in simulated.values())
        number += 1
        start = Start(fit.v, fit.psi)
        found = trace(surrogate, observed, rules, seed=analysis.seed, starts=(start,))
        say(f"held by these pours, {found.verdict.kind}: {found.verdict.reason}")


def anchored(
    surrogate: Surrogate, fits: Sequence[tuple[Fit, Sequence[ConditionPours]]]
) -> Surrogate:
    """Returns the surrogate held at each fit by fresh pours there, and where it was before."""
    plain = replace(surrogate, anchor=None)
    before = () if surrogate.anchor is None else surrogate.anchor.holds
    holds = (*before, *(_hold(plain, *each) for each in fits))
    return replace(plain, anchor=Anchor(holds))


def _hold(plain: Surrogate, fit: Fit, fresh: Sequence[ConditionPours]) -> Hold:
    stack = StackedMeans.of(plain, fresh)
    local = LinearisedSurrogate.at(plain, stack.conditions, stack.counts, fit.v)
    count, size = stack.means.shape
    noise = local.pour_covariance(fit.v, fit.psi).reshape(count, size, count, size)
    return Hold(
        place=np.concatenate([cube_from_normal(fit.v), fit.psi]),
        conditions=stack.conditions,
        gaps=stack.means - local.mean(fit.v, fit.psi).reshape(count, size),
        covariances=noise[range(count), :, range(count), :],
    )


def _usable(analysis: Analysis, rows: dict[str, Array]) -> list[ConditionPours]:
    """Pours under the conditions where there are enough of them."""
    return [analysis.pours(c, rows[c.name]) for c in analysis.fitted if len(rows[c.name]) >= FEWEST]
