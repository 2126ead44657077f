"""Looks over the prior until the verdict's model is one that has been looked at."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.check.prior_pours import Look, look
from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.refine import Rows
from granulcal.loop.surrogate.observation import Observation
from granulcal.loop.surrogate.store_surrogate import fit_surrogate
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import Task
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Trace, trace

__all__ = ["LOOKS", "Seen", "look_over"]

Array = NDArray[np.float64]

LOOKS = 2
"""Most looks: a second one where the first changed the winner."""


@dataclass(frozen=True)
class Seen:
    """What is known after the looks.

    Attributes:
        trace: of the surrogate that knows the pours of the looks.
        surrogate: that surrogate.
        draws: random draws that were poured of the models in turn.
        best: the look at the verdict's model; None where nothing was usable, or none was asked for.
    """

    trace: Trace
    surrogate: Surrogate
    draws: int
    best: Look | None


def look_over(
    forward: Forward,
    task: Task,
    store: Archive,
    found: Trace,
    observed: Sequence[Observation],
    measured: dict[str, Array],
    surrogate: Surrogate,
    rules: Thresholds,
    more: list[Rows],
    *,
    seed: int,
    say: Callable[[str], None],
) -> Seen:
    """Returns the trace after random draws of its winner were poured; `more` grows by the pours."""
    spread = surrogate.raw_spread[: Measures.of(task.scene).head]
    draws, best = 0, None
    for number in range(LOOKS if rules.look else 0):
        winner = found.best.effects
        best = look(
            forward,
            task,
            store.plan,
            found,
            measured,
            spread,
            count=rules.look,
            number=number,
            seed=seed,
        )
        draws += rules.look
        if best.rows is None:
            break
        more.append(best.rows)
        surrogate = fit_surrogate(store, seed=seed, say=say, more=more)
        found = trace(surrogate, observed, rules, seed=seed, starts=best.starts(store.plan.design))
        say(
            f"after a look at {rules.look} random draws of "
            f"{' + '.join(winner) or 'the base model'}, "
            f"{found.verdict.kind}: {found.verdict.reason}"
        )
        if found.best.effects == winner:
            break
    if best is not None and (best.effects != found.best.effects or len(best.theta) == 0):
        best = None
    return Seen(found, surrogate, draws, best)
