"""All that the surrogate learns from further pours before its models are held against their own."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.fit_rounds import fit_rounds
from granulcal.loop.check.prior_pours import PriorPours
from granulcal.loop.check.prior_rounds import prior_rounds
from granulcal.loop.check.rival_rounds import rival_rounds
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.trace import Trace

__all__ = ["Learning", "learning"]

Array = NDArray[np.float64]


class Learning(NamedTuple):
    """What is known after all rounds; what was before them is let go, for each keeps gigabytes.

    Attributes:
        trace: of the surrogate that knows all pours.
        surrogate: that surrogate.
        best: pours of the prior of the verdict's model; None where nothing was usable.
        draws: random draws that were poured of the models in turn.
        drawn_of: names of the effects of the model that the last of them were of.
        pours: of the rounds, without the draws.
    """

    trace: Trace
    surrogate: Surrogate
    best: PriorPours | None
    draws: int
    drawn_of: tuple[str, ...]
    pours: int


def learning(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    observed: Sequence[ConditionPours],
    measured: dict[str, Array],
    rounds: int,
) -> Learning:
    """Returns what pours at the fits, of rivals and of the prior say, and of rivals once more.

    Args:
        analysis: task and pours.
        surrogate: of the archive.
        found: what it says.
        observed: pours under the conditions to fit.
        measured: their statistics, by name of the condition.
        rounds: of pours at the fits, at most.
    """
    near = fit_rounds(analysis, surrogate, found, observed, rounds)
    beside = rival_rounds(analysis, near.surrogate, near.trace, observed)
    seen = prior_rounds(analysis, beside.surrogate, beside.trace, observed, measured)
    begin = () if seen.best is None else seen.best.starts(analysis.plan.design)
    again = rival_rounds(
        analysis, seen.surrogate, seen.trace, observed, beside.rounds, starts=begin
    )
    return Learning(
        trace=again.trace,
        surrogate=again.surrogate,
        best=seen.best,
        draws=seen.draws,
        drawn_of=seen.of,
        pours=near.pours + beside.pours + again.pours,
    )
