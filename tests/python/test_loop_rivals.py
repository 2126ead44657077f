"""A name and the rivals within its reach: what is hardly known may be true."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from small_archive import surrogate_of

from granulcal.loop import ConditionPours, Design, Surrogate, Thresholds, trace
from granulcal.loop.analysis import Analysis
from granulcal.loop.check import rival_rounds as module
from granulcal.loop.check import rivals
from granulcal.loop.check.by_pours import ByPours, log_evidence
from granulcal.loop.check.placed import Placed
from granulcal.loop.check.rival_rounds import ROUNDS, RivalRounds, rival_rounds
from granulcal.loop.check.rivals import as_named, within_reach
from granulcal.loop.check.weigh import Weighed, judged
from granulcal.loop.effects.design import cube_from_normal, normal_from_cube
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.test.trace import Trace
from granulcal.loop.test.verdict import Verdict

Array = NDArray[np.float64]

RULES = Thresholds(replicates=300, replicates_after=100, refits=4)
PLACES = (0.0, 0.5, 1.0)
SIZE, POURS, EACH, SETS = 6, 3, 24, 6
SLOPES, ALONG, ASIDE = np.linalg.qr(np.random.default_rng(3).standard_normal((SIZE, 3)))[0].T
# The second effect does nearly what the first one does.
DIRECTIONS = 2.5 * np.array([ALONG, 0.9 * ALONG + 0.436 * ASIDE])


def pours(u: float, c: float, psi: Sequence[float], count: int, seed: list[int]) -> Array:
    """x = A (2 u - 1) + sum_k psi_k D_k (1 + c) + noise."""
    mean = 2 * (2 * u - 1) * SLOPES + (1 + c) * (np.asarray(psi) @ DIRECTIONS)
    return mean + 0.3 * np.random.default_rng(seed).standard_normal((count, SIZE))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """Of an archive that has many readings of the image and few pours of the other effect."""
    generator = np.random.default_rng(0)
    u, c, psi = generator.random(400), generator.random(400), np.zeros((400, 2))
    psi[250:394, 0], psi[394:, 1] = generator.random(144), generator.random(6)
    return surrogate_of(pours, ("image", "poured"), u, c, psi)


def farther(found: Trace, effect: str) -> float:
    """How much more probable an effect may be than its fit [nat]."""
    (one,) = (one for one in found.explanations if one.effects == (effect,))
    return rivals._farthest(found, found.model_of(one))[1]


def rounds(
    surrogate: Surrogate, psi: Sequence[float], number: int, monkeypatch: pytest.MonkeyPatch
) -> tuple[Trace, RivalRounds]:
    """What the fits say of a set, and what they say once rivals have been poured."""

    def further(_: Any, found: Trace, number: int, beside: Sequence[Fit]) -> list[Rows]:
        made = []
        for i, fit in enumerate([found.base_fit, *beside]):
            theta = np.tile(cube_from_normal(fit.v), (EACH, 1))
            where = np.resize(PLACES, (EACH, 1))
            x = [
                pours(float(theta[0, 0]), float(c[0]), fit.psi.tolist(), 1, [9, number, i, j])
                for j, c in enumerate(where)
            ]
            made.append(Rows(theta, where, np.tile(fit.psi, (EACH, 1)), np.concatenate(x)))
        return made

    monkeypatch.setattr(module, "further", further)
    nothing: Any = None
    analysis = Analysis(nothing, nothing, nothing, RULES, number, lambda _: None)
    observed = [
        ConditionPours.of(f"{c:g}", [c], pours(0.4, c, psi, POURS, [number, i]))
        for i, c in enumerate(PLACES)
    ]
    found = trace(surrogate, observed, RULES, seed=number)
    return found, rival_rounds(analysis, surrogate, found, observed)


@pytest.mark.parametrize("psi", [(0.2, 0.0), (0.0, 0.2)])
def test_who_is_poured_is_told_apart(
    surrogate: Surrogate, psi: tuple[float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    true = ("poured",) if psi[1] else ("image",)
    before = after = made = 0
    for number in range(SETS):
        found, there = rounds(surrogate, psi, number, monkeypatch)
        before += found.verdict.named == true
        after += there.trace.verdict.named == true
        made += there.rounds
        gain = {one: farther(found, one) for one in ("image", "poured")}
        assert gain["poured"] > 1 > abs(gain["image"])
        assert there.rounds <= ROUNDS and (there.pours > 0) == (there.rounds > 0)
        if not there.rounds:
            assert there.trace is found and there.surrogate is surrogate
        # What has been poured is known: its error costs less.
        else:
            assert farther(there.trace, "poured") < gain["poured"]
    assert made and after > before and after >= SETS - 1


def test_nothing_is_poured_where_nothing_is_named(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(SETS):
        found, there = rounds(surrogate, (0.0, 0.0), number, monkeypatch)
        assert not found.verdict.named and there.rounds == there.pours == 0
        assert there.trace is found


def test_a_rival_is_within_reach_by_what_is_not_known_of_it(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, _ = rounds(surrogate, (0.2, 0.0), 1, monkeypatch)
    best, other = found.explanations[:2]
    assert (best.effects, other.effects) == (("image",), ("poured",))
    (rival,) = within_reach(found, RULES)
    assert rival.one is other and rival.reach > best.log_probability - RULES.rivals
    assert rival.reach == pytest.approx(other.log_probability + farther(found, "poured"))
    there = as_named(found, rival)
    assert there.best.effects == other.effects and there.fit_of(there.best) is rival.fit
    assert there.best.best_strengths[0] == rival.fit.psi[1] and not rival.fit.psi[0]
    gap = best.log_probability - other.log_probability

    def reached(gain: float) -> bool:
        with monkeypatch.context() as once:
            once.setattr(rivals, "_farthest", lambda _, model: (model.fit, gain))
            return bool(within_reach(found, RULES))

    assert not reached(gap - RULES.rivals - 0.01) and reached(gap - RULES.rivals + 0.01)
    # What is parallel near the base fit is a rival all the same, what is declared of one kind none.
    assert within_reach(replace(found, families=(("image", "poured"),)), RULES)
    with monkeypatch.context() as once:
        once.setattr(Design, "family", lambda *_: "one")
        assert not within_reach(found, RULES)
    none = Verdict("NONE", (), (), 0.5, "")
    assert not within_reach(replace(found, verdict=none), RULES)


def test_a_fit_that_stays_where_nothing_is_unknown_does_not_hide_a_rival(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    # At a strength of 0 the surrogate has no error of an effect, and a fit may end there.
    found, _ = rounds(surrogate, (0.2, 0.0), 1, monkeypatch)
    model = found.model_of(found.explanations[1])
    stuck = replace(model, fit=replace(found.base_fit, active=(1,)))
    fit, gain = rivals._farthest(found, stuck)
    assert fit.psi[1] > 0.05 and gain > 5


def test_the_evidence_by_pours_does_not_depend_on_where_they_are(surrogate: Surrogate) -> None:
    base: Any = SimpleNamespace(v=np.array([-0.2]), psi=np.zeros(2), active=())

    def at(u: float, psi: float, active: tuple[int, ...]) -> float:
        fit = SimpleNamespace(v=normal_from_cube(np.array([u])), psi=np.zeros(2), active=active)
        fit.psi[list(active)] = psi
        fresh = [
            ConditionPours.of(f"{c:g}", [c], pours(u, c, fit.psi.tolist(), 4000, [3, i]))
            for i, c in enumerate(PLACES)
        ]
        return log_evidence(surrogate, base, cast(Fit, fit), measured, fresh)

    measured = [
        ConditionPours.of(f"{c:g}", [c], pours(0.4, c, (0.3, 0.0), POURS, [1, i]))
        for i, c in enumerate(PLACES)
    ]
    true = at(0.4, 0.3, (0,))
    assert at(0.42, 0.34, (0,)) == pytest.approx(true, abs=1.0)
    assert true - at(0.4, 0.3, (1,)) > 3 and true - at(0.4, 0.0, ()) > 20


def weighed(trace: Trace, *models: tuple[tuple[str, ...], float, float]) -> list[Weighed]:
    """Models with the log probability and the p of their own pours."""
    placed = cast(Placed, None)
    by_effects = {one.effects: one for one in trace.explanations}
    found = [
        Weighed(by_effects[effects], placed, ByPours(effects, log, p)) for effects, log, p in models
    ]
    return sorted(found, key=lambda w: -w.said.log_probability)


def test_own_pours_decide_between_a_name_and_its_rivals(
    surrogate: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, _ = rounds(surrogate, (0.2, 0.0), 1, monkeypatch)
    image, other = ("image",), ("poured",)
    one = found.explanations[0]
    pair = replace(one, effects=(*image, *other))
    named = replace(found, explanations=(*found.explanations[:2], pair))

    def said(*models: tuple[tuple[str, ...], float, float]) -> tuple[str, tuple[str, ...]]:
        word = judged(named, weighed(named, *models), RULES)
        return word.kind, word.named

    assert judged(found, [], RULES) is found.verdict
    assert said((image, 9.0, 0.5), (other, 2.0, 0.5)) == ("EFFECT", image)
    assert said((image, 2.0, 0.5), (other, 9.0, 0.5)) == ("EFFECT", other)
    assert said((image, 9.0, 0.5), (other, 7.0, 0.5)) == ("SET", (*image, *other))
    # Whose pours leave something is none, however probable; where all do the fits have the word.
    assert said((image, 2.0, 0.5), (other, 9.0, 0.01)) == ("EFFECT", image)
    assert said((image, 2.0, 0.01), (other, 9.0, 0.01)) == ("EFFECT", image)
    # Two effects give way to one that is as probable.
    assert said((pair.effects, 9.0, 0.5), (other, 7.0, 0.5)) == ("EFFECT", other)
    assert said((pair.effects, 9.0, 0.5), (other, 5.0, 0.5)) == ("EFFECTS", pair.effects)
    word = judged(named, weighed(named, (image, 9.0, 0.5), (other, 2.0, 0.5)), RULES)
    assert "told from poured by 7.0 nat" in word.reason
