"""Rounds of pours where the fits are, while the residual test rejects."""

from collections.abc import Sequence
from typing import NamedTuple

from granulcal.loop.analysis import Analysis
from granulcal.loop.pours.refine import further
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.conditioned import conditioned
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.trace import Trace, trace

__all__ = ["FitRounds", "fit_rounds"]


class FitRounds(NamedTuple):
    """What is known after the rounds.

    Attributes:
        trace: of the surrogate that knows their pours.
        surrogate: that surrogate.
        pours: that were made.
    """

    trace: Trace
    surrogate: Surrogate
    pours: int


def fit_rounds(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    observed: Sequence[ConditionPours],
    rounds: int,
) -> FitRounds:
    """Returns the trace once the residual test rejects no more, or after `rounds`.

    Args:
        analysis: task and pours.
        surrogate: of the archive.
        found: what it says.
        observed: pours under the conditions to fit.
        rounds: that are made at most.
    """
    pours = 0
    for number in range(rounds):
        if found.residual_test.p > analysis.rules.name:
            break
        parts = further(analysis, found, number)
        if not parts:
            break
        more = Rows.joined(parts)
        pours += len(more)
        surrogate = conditioned(surrogate, more)
        found = trace(surrogate, observed, analysis.rules, seed=analysis.seed)
        word, why = found.verdict.kind, found.verdict.reason
        analysis.say(f"after pours where the fits are, {word}: {why}")
    return FitRounds(found, surrogate, pours)
