"""Pours of a name and of the rivals that are within its reach, before anything is asked of it.

The surrogate knows what an effect of the image does from images of pours that it has anyway, and
what a poured effect does from that effect's share of the archive alone. A name is held against
models that are known as well as itself: it and each rival within reach (`rivals.py`) are poured
where their fits are (`refine.py`), the surrogate is conditioned on these pours, and everything is
asked again, the residual test included. A set without any effect has to be rejected once more to be
named, so that false alarms can only become fewer.
"""

from collections.abc import Sequence
from typing import NamedTuple

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.rivals import within_reach
from granulcal.loop.pours.refine import further
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.baseline import Start
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.conditioned import conditioned
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.trace import Trace, trace

__all__ = ["ROUNDS", "RivalRounds", "rival_rounds"]

ROUNDS = 2
"""Most rounds of one analysis."""
# Of their seeds, after those of `--rounds`.
_FIRST = 50


class RivalRounds(NamedTuple):
    """What is known after the rounds.

    Attributes:
        trace: of the surrogate that knows their pours.
        surrogate: that surrogate.
        rounds: how many there were, those before these included.
        pours: that were made.
    """

    trace: Trace
    surrogate: Surrogate
    rounds: int
    pours: int


def rival_rounds(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    observed: Sequence[ConditionPours],
    rounds: int = 0,
    starts: Sequence[Start] = (),
) -> RivalRounds:
    """Returns the trace once no rival is within reach of the name, or after `ROUNDS` rounds.

    Args:
        analysis: task and pours.
        surrogate: of the archive.
        found: what it says.
        observed: pours under the conditions to fit.
        rounds: that were made before.
        starts: where fits begin as well.
    """
    pours = 0
    while rounds < ROUNDS:
        rivals = within_reach(found, analysis.rules)
        if not rivals:
            break
        fits = [found.fit_of(found.best), *(rival.fit for rival in rivals)]
        more = further(analysis, found, _FIRST + rounds, fits)
        if not more:
            break
        rounds, pours = rounds + 1, pours + sum(map(len, more))
        begin = [*starts, *(Start(fit.v, fit.psi) for fit in fits)]
        surrogate = conditioned(surrogate, Rows.joined(more))
        named = ", ".join(found.verdict.named)
        found = trace(surrogate, observed, analysis.rules, seed=analysis.seed, starts=begin)
        others = ", ".join(" + ".join(rival.one.effects) for rival in rivals)
        analysis.say(
            f"after pours of {named} and of what they could make as probable ({others}), "
            f"{found.verdict.kind}: {found.verdict.reason}"
        )
    return RivalRounds(found, surrogate, rounds, pours)
