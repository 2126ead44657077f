"""Rounds of pours of the prior until the verdict's model is one that was poured."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.prior_pours import PriorPours, prior_pours
from granulcal.loop.pours.measures import Measures
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.conditioned import conditioned
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.trace import Trace, trace

__all__ = ["ROUNDS", "PriorCheck", "drawn", "prior_rounds"]

Array = NDArray[np.float64]

ROUNDS = 2
"""Most rounds: a second one where the first changed the winner."""


@dataclass(frozen=True)
class PriorCheck:
    """What is known after the rounds.

    Attributes:
        trace: of the surrogate that knows the pours of the rounds.
        surrogate: that surrogate.
        draws: random draws that were poured of the models in turn.
        best: pours of the verdict's model; None where nothing was usable, none was asked for, or
            the last round has changed the winner once more.
        of: effects of the model that the last round's draws were of.
    """

    trace: Trace
    surrogate: Surrogate
    draws: int
    best: PriorPours | None
    of: tuple[str, ...]


def prior_rounds(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    observed: Sequence[ConditionPours],
    measured: dict[str, Array],
) -> PriorCheck:
    """Returns the trace after random draws of its winner were poured."""
    rules, seed, say = analysis.rules, analysis.seed, analysis.say
    spread, draws, best = _spread(analysis, surrogate), 0, None
    winner = found.best.effects
    for number in range(ROUNDS if rules.look else 0):
        winner = found.best.effects
        best = prior_pours(analysis, found, measured, spread, number)
        draws += rules.look
        if best.rows is None:
            break
        surrogate = conditioned(surrogate, best.rows)
        starts = best.starts(analysis.plan.design)
        found = trace(surrogate, observed, rules, seed=seed, starts=starts)
        say(
            f"after {rules.look} random draws of "
            f"{' + '.join(winner) or 'the base model'}, "
            f"{found.verdict.kind}: {found.verdict.reason}"
        )
        if found.best.effects == winner:
            break
    if best is not None and (best.effects != found.best.effects or len(best.theta) == 0):
        best = None
    return PriorCheck(found, surrogate, draws, best, winner)


def drawn(
    analysis: Analysis, surrogate: Surrogate, found: Trace, measured: dict[str, Array]
) -> PriorPours | None:
    """Returns random draws of a winner that came after the rounds; None where none is usable.

    They are for the check alone: the surrogate does not learn from them.
    """
    pours = prior_pours(analysis, found, measured, _spread(analysis, surrogate), ROUNDS)
    return pours if len(pours.theta) else None


def _spread(analysis: Analysis, surrogate: Surrogate) -> Array:
    return surrogate.raw_spread[: Measures.of(analysis.task.scene).head]
