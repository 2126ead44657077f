"""What the models' own pours teach a surrogate that they contradict."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from small_archive import surrogate_of

from granulcal.loop import ConditionPours, Surrogate, Thresholds, trace
from granulcal.loop.analysis import Analysis
from granulcal.loop.check import look_again as module
from granulcal.loop.check import placed, settle, weigh
from granulcal.loop.check.look_again import ROUNDS, Looked, look_again
from granulcal.loop.check.standing import stand
from granulcal.loop.pours.replicates import ModelPours
from granulcal.loop.test.trace import Explanation, Trace

Array = NDArray[np.float64]

RULES = Thresholds(replicates=300, replicates_after=100, refits=4)
PLACES = (0.0, 0.5, 1.0)
SIZE, POURS, FRESH, SETS = 6, 6, 10, 6
EFFECTS = "first", "second"
SLOPES, *DIRECTIONS = np.random.default_rng(3).standard_normal((3, SIZE))


def pours(u: float, c: float, psi: Sequence[float], count: int, seed: list[int]) -> Array:
    """x = A (2 u - 1) + sum_k psi_k D_k (1 + c) + noise."""
    mean = (2 * u - 1) * SLOPES + (1 + c) * (np.asarray(psi) @ np.array(DIRECTIONS))
    return mean + 0.3 * np.random.default_rng(seed).standard_normal((count, SIZE))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """Of an archive that has hardly a pour of the first effect, and is unsure of it."""
    generator = np.random.default_rng(0)
    u, c, psi = generator.random(250), generator.random(250), np.zeros((250, 2))
    psi[180:183, 0], psi[190:, 1] = generator.random(3), generator.random(60)
    return surrogate_of(pours, EFFECTS, u, c, psi)


def looked(
    surrogate: Surrogate, psi: Sequence[float], number: int, monkeypatch: pytest.MonkeyPatch
) -> tuple[Trace, Looked, set[int]]:
    """What the fits say, what is known after its pours, and the seeds of all of them."""
    seeds: set[int] = set()

    def of(one: Explanation, c: float, seed: int) -> Array:
        strengths = dict(zip(one.effects, one.best_strengths.tolist(), strict=True))
        psi = [strengths.get(name, 0.0) for name in EFFECTS]
        part = PLACES.index(c), len(one.effects)
        return pours(float(one.theta[0]), c, psi, FRESH, [100 + number, seed, *part])

    def both(_: Any, __: Any, condition: Any, found: Trace, seed: int) -> ModelPours:
        seeds.add(seed)
        base = of(found.base, condition.at, seed)
        return ModelPours(
            base, base if found.best is found.base else of(found.best, condition.at, seed)
        )

    monkeypatch.setattr(settle, "both", both)
    for where in (placed, weigh):
        monkeypatch.setattr(
            where, "pours_of", lambda _, __, condition, one, seed: of(one, condition.at, seed)
        )
    monkeypatch.setattr(module, "model_scene", lambda _, condition, one: (condition.at, one))
    monkeypatch.setattr(module, "model_faults", lambda _, one: {})
    monkeypatch.setattr(module, "seeds_of_replicates", lambda _, seed: seed)
    conditions = [SimpleNamespace(name=f"{c:g}", at=c, session="") for c in PLACES]
    task: Any = SimpleNamespace(of=lambda _: conditions, library=())
    plan: Any = SimpleNamespace(unit=lambda at: np.array([at]), design=surrogate.design)
    forward: Any = SimpleNamespace(pours=lambda scene, seed, _: of(scene[1], scene[0], seed))
    analysis = Analysis(task, plan, forward, RULES, number, lambda _: None)
    seen = {f"{c:g}": pours(0.4, c, psi, POURS, [number, i]) for i, c in enumerate(PLACES)}
    observed = [ConditionPours.of(name, [float(name)], rows) for name, rows in seen.items()]
    found = trace(surrogate, observed, RULES, seed=number)
    return found, look_again(analysis, surrogate, found, observed, seen), seeds


def word(there: Looked) -> tuple[str, set[str]]:
    """The verdict that stands."""
    standing = stand(
        there.placed.trace.verdict,
        RULES,
        confirmed=there.settled.confirmed,
        looked=there.rounds,
        own=there.placed.own,
        of_base=there.placed.of_base,
    )
    assert standing.to_dict()["looked_again"] == there.rounds
    return standing.verdict.kind, set(standing.verdict.named)


def test_pours_mend_what_the_surrogate_is_unsure_of(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The fits have both effects, a surrogate's error off: what their pours leave takes the word.
    truth = 0.8, 0.25
    with monkeypatch.context() as once:
        once.setattr(module, "ROUNDS", 0)
        before = [word(looked(surrogate, truth, i, monkeypatch)[1]) for i in range(SETS)]
    after = 0
    for number in range(SETS):
        _, there, seeds = looked(surrogate, truth, number, monkeypatch)
        after += word(there) == ("EFFECTS", set(EFFECTS))
        # Each round has pours of its own, and the surrogate has learnt from those before.
        assert len(seeds) > there.rounds and there.rounds <= ROUNDS
        learnt = len(there.settled.surrogate.rows) - len(surrogate.rows)
        assert (learnt > 0) == (there.pours > 0) == (there.rounds > 0)
    assert not any(named for _, named in before) and after >= SETS // 2


def test_pours_that_agree_with_the_fits_end_it(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    rounds = 0
    for number in range(SETS):
        found, there, _ = looked(surrogate, (0.0, 0.6), number, monkeypatch)
        rounds += there.rounds
        if there.rounds == there.settled.anchors == 0:
            assert there.settled.trace is found and there.settled.surrogate is surrogate
            assert there.pours == 0
        assert word(there) == ("EFFECT", {"second"})
    assert rounds <= 4


def test_nothing_is_made_of_nothing(surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch) -> None:
    words = [word(looked(surrogate, (0.0, 0.0), i, monkeypatch)[1]) for i in range(2 * SETS)]
    # Each has a chance of 1 in 20.
    assert sum(kind != "NONE" for kind, _ in words) <= 3
    assert not any(named for _, named in words)
