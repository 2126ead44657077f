"""The verdict's model where its own pours put it."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Design, Effect, Surrogate, Thresholds, trace
from granulcal.loop.analysis import Analysis
from granulcal.loop.check import placed as module
from granulcal.loop.check.placed import Placed, placed
from granulcal.loop.pours.replicates import ModelPours
from granulcal.loop.test.trace import Explanation, Trace

Array = NDArray[np.float64]

RULES = Thresholds(replicates=300, replicates_after=100, refits=4)
PLACES = (0.0, 0.5, 1.0)
SIZE, POURS, FRESH, SETS = 6, 3, 10, 8
SLOPES, DIRECTION = np.random.default_rng(3).standard_normal((2, SIZE))


def pours(u: float, c: float, psi: float, count: int, seed: list[int], *, gain: float) -> Array:
    """x = A (2 u - 1) + gain psi D (1 + c) + noise."""
    mean = (2 * u - 1) * SLOPES + gain * (1 + c) * psi * DIRECTION
    return mean + 0.3 * np.random.default_rng(seed).standard_normal((count, SIZE))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """Of a simulator whose effect is by a quarter stronger than that of the pours below."""
    generator = np.random.default_rng(0)
    u, c, psi = generator.random(300), generator.random(300), np.zeros(300)
    psi[220:] = generator.random(80)
    rows = zip(u, c, psi, strict=True)
    x = np.concatenate([pours(*row, 1, [7, i], gain=1.25) for i, row in enumerate(rows)])
    design = Design(("a",), ("height",), (Effect("first"),))
    return Surrogate.fit(design, u[:, None], c[:, None], psi[:, None], x, features=4)


def measured(psi: float, number: int) -> dict[str, Array]:
    """What is measured under each condition."""
    return {
        f"{c:g}": pours(0.4, c, psi, POURS, [number, i], gain=1.0) for i, c in enumerate(PLACES)
    }


def place(
    surrogate: Surrogate,
    psi: float,
    number: int,
    monkeypatch: pytest.MonkeyPatch,
    *,
    away: float = 0.0,
) -> tuple[Trace, Placed]:
    """What the fits say, and where the model's own pours put it; `away` misleads them."""

    def of(one: Explanation, c: float, step: int, off: float = 0.0) -> Array:
        strength, u = float(one.best_strengths.sum()) + off, float(one.theta[0])
        return pours(u, c, strength, FRESH, [100 + number, step, PLACES.index(c)], gain=1.0)

    monkeypatch.setattr(
        module, "pours_of", lambda _, __, condition, one, ___: of(one, condition.at, 1, away)
    )
    conditions = [SimpleNamespace(name=f"{c:g}", at=c, session="") for c in PLACES]
    task: Any = SimpleNamespace(of=lambda _: conditions)
    plan: Any = SimpleNamespace(unit=lambda at: np.array([at]))
    forward: Any = None
    analysis = Analysis(task, plan, forward, RULES, number, lambda _: None)
    seen = measured(psi, number)
    observed = [ConditionPours.of(name, [float(name)], rows) for name, rows in seen.items()]
    found = trace(surrogate, observed, RULES, seed=number)
    simulated = {f"{c:g}": ModelPours(of(found.base, c, 0), of(found.best, c, 0)) for c in PLACES}
    return found, placed(analysis, surrogate, found, seen, simulated)


def test_a_step_takes_the_model_to_where_its_pours_are_those_measured(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, after, moved = [], [], 0
    for number in range(SETS):
        found, there = place(surrogate, 0.6, number, monkeypatch)
        assert found.verdict.named == ("first",)
        at = there.trace.best
        moved += at is not found.best
        before.append(float(found.best.best_strengths[0]) - 0.6)
        after.append(float(at.best_strengths[0]) - 0.6)
        # The base model stays, and so does what the surrogate left of the data.
        assert there.trace.base is found.base and there.pours == FRESH * len(PLACES)
        assert np.array_equal(there.trace.residuals_of(at), found.residuals_of(found.best))
        assert there.own is not None
        assert abs(float(there.own.strengths[0]) - 0.6) < 0.15
    # By the surrogate's quarter 0.48, in one step nearly all of the way back.
    assert moved >= SETS - 1
    assert np.mean(before) < -0.08 and abs(np.mean(after)) < 0.04


def test_a_step_that_leads_away_is_not_taken(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, there = place(surrogate, 0.6, 1, monkeypatch, away=0.4)
    assert there.trace is found and there.pours == FRESH * len(PLACES)


def test_the_base_model_is_not_moved(surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch) -> None:
    found, there = place(surrogate, 0.0, 2, monkeypatch)
    assert found.best is found.base and there.trace is found and there.pours == 0
