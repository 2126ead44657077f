"""Random draws of the prior: of the model that wins, however often the winner changes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from granulcal.loop.check import learning as module
from granulcal.loop.check import prior_rounds as rounds
from granulcal.loop.check.prior_pours import PriorPours

LOOK = 24


def found(*effects: str) -> Any:
    """A trace of which the winner alone is asked."""
    verdict = SimpleNamespace(kind="EFFECT", reason="")
    return SimpleNamespace(best=SimpleNamespace(effects=effects), verdict=verdict)


@pytest.mark.parametrize(
    ("winners", "draws", "drawn_of", "is_known"),
    [
        (("tilt", "tilt"), LOOK, ("tilt",), True),
        (("tilt", "drag", "drag"), 2 * LOOK, ("drag",), True),
        # None of the count has been poured: close_loop asks for draws of it by this.
        (("tilt", "drag", "count"), 2 * LOOK, ("drag",), False),
    ],
)
def test_the_last_draws_are_told_apart_from_a_winner_that_came_after_them(
    winners: tuple[str, ...],
    draws: int,
    drawn_of: tuple[str, ...],
    is_known: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    traces = iter([found(name) for name in winners])
    first = next(traces)

    def poured(_: Any, trace: Any, *__: Any) -> PriorPours:
        one = np.zeros((1, 1))
        rows: Any = "rows"
        return PriorPours(trace.best.effects, rows, one, one, np.zeros(1))

    monkeypatch.setattr(PriorPours, "starts", lambda *_: ())
    monkeypatch.setattr(rounds, "prior_pours", poured)
    monkeypatch.setattr(rounds, "conditioned", lambda surrogate, _: surrogate)
    monkeypatch.setattr(rounds, "trace", lambda *_, **__: next(traces))
    monkeypatch.setattr(rounds, "_spread", lambda *_: np.ones(1))
    same = SimpleNamespace(surrogate=None, trace=first, pours=0, rounds=0)
    monkeypatch.setattr(module, "fit_rounds", lambda *_: same)
    monkeypatch.setattr(
        module,
        "rival_rounds",
        lambda _, surrogate, trace, *__, **___: SimpleNamespace(
            surrogate=surrogate, trace=trace, pours=0, rounds=0
        ),
    )
    rules = SimpleNamespace(look=LOOK)
    plan = SimpleNamespace(design=None)
    analysis: Any = SimpleNamespace(rules=rules, seed=0, plan=plan, say=lambda _: None)
    nothing: Any = None
    seen = module.learning(analysis, nothing, first, [], {}, 0)
    assert seen.trace.best.effects == (winners[-1],)
    assert (seen.draws, seen.drawn_of, seen.best is not None) == (draws, drawn_of, is_known)
