"""Fresh pours that hold a surrogate where it is wrong."""

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Design, Effect, Surrogate, Thresholds, trace
from granulcal.loop.analysis import Analysis
from granulcal.loop.check import settle as module
from granulcal.loop.check.confirm import confirm
from granulcal.loop.check.settle import ANCHORS, Settled, anchored, settle
from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.pours.replicates import ModelPours
from granulcal.loop.surrogate.anchor import Anchor, Hold
from granulcal.loop.test.trace import Explanation, Trace

Array = NDArray[np.float64]

RULES = Thresholds(replicates=300, replicates_after=100, refits=4)
PLACES = (0.0, 0.5, 1.0)
SIZE, POURS, FRESH, SETS = 6, 3, 10, 12
U = 0.4


def test_gaps_are_exact_where_they_are_known_and_gone_far_away() -> None:
    gaps = np.array([[1.0, -2.0], [0.5, 3.0]])
    sizes = np.stack([np.eye(2), 4 * np.eye(2)])
    anchor = Hold(np.zeros(2), np.array([[0.0], [1.0]]), gaps, sizes)
    assert anchor.at(np.array([[1.0], [0.0]])) == pytest.approx(gaps[::-1])
    assert np.abs(anchor.at(np.array([[4.0]]))).max() < 1e-9
    between = anchor.at(np.array([[0.5]]))[0]
    # By symmetry both have the same weight, below 1/2 for half a unit is more than the width.
    assert between == pytest.approx(between[0] / 1.5 * (gaps[0] + gaps[1])) and between[0] < 0.75
    covariance = anchor.covariance(np.array([[0.0], [1.0]]))
    assert covariance[0, :, 0] == pytest.approx(np.eye(2))
    assert covariance[1, :, 1] == pytest.approx(4 * np.eye(2))
    assert covariance[0, :, 1] == pytest.approx(np.zeros((2, 2)), abs=1e-9)


@pytest.mark.parametrize("inputs", [0, 1])
def test_repeats_of_one_condition_have_the_mean_of_their_gaps(inputs: int) -> None:
    where, gaps = np.full((2, inputs), 0.3), np.array([[1.0, 4.0], [3.0, 0.0]])
    anchor = Hold(np.zeros(2), where, gaps, np.stack([np.eye(2)] * 2))
    assert anchor.at(where) == pytest.approx(np.tile([2.0, 2.0], (2, 1)))
    # The mean of two has half the variance, and both rows are this one mean.
    for i in range(2):
        for j in range(2):
            assert anchor.covariance(where)[i, :, j] == pytest.approx(0.5 * np.eye(2))


def test_each_fit_has_its_own_gap_and_far_places_the_mean() -> None:
    where, sizes = np.zeros((1, 1)), np.eye(2)[None]
    gaps = np.array([[[1.0, -2.0]], [[0.5, 3.0]]])
    places = np.array([[0.3, 0.0], [0.8, 2.0]])
    holds = [Hold(z, where, gap, sizes) for z, gap in zip(places, gaps, strict=True)]
    anchor = Anchor(tuple(holds))

    def at(z: Array) -> Array:
        return anchor.at(z[None, :1], where, z[None, 1:])[0]

    mean = gaps.mean(axis=0)[0]
    for z, gap in zip(places, gaps, strict=True):
        assert np.abs(at(z) - gap[0]).max() < 0.1 * np.abs(gap[0] - mean).max()
        covariance = anchor.covariance(z[:1], where, z[1:])[0, :, 0]
        assert covariance == pytest.approx(np.eye(2), rel=0.1, abs=0.1)
    for far in (places.mean(axis=0), np.array([0.5, 9.0])):
        assert at(far) == pytest.approx(mean, abs=0.05)
        # The mean of two has half the variance.
        covariance = anchor.covariance(far[:1], where, far[1:])[0, :, 0]
        assert covariance == pytest.approx(0.5 * np.eye(2), abs=0.02)
    # One alone holds everywhere.
    alone = Anchor(tuple(holds[:1]))
    assert alone.at(np.array([[9.0]]), where, np.array([[-3.0]])) == pytest.approx(gaps[0])


def test_pours_of_one_fit_again_count_as_more_of_the_same() -> None:
    where, sizes, z = np.zeros((1, 1)), np.eye(2)[None], np.array([0.3, 0.0])
    gaps = np.array([[[1.0, -2.0]], [[0.0, 2.0]]])
    anchor = Anchor(tuple(Hold(z, where, gap, sizes) for gap in gaps))
    assert anchor.at(z[None, :1], where, z[None, 1:])[0] == pytest.approx([0.5, 0.0])
    covariance = anchor.covariance(z[:1], where, z[1:])[0, :, 0]
    assert covariance == pytest.approx(0.5 * np.eye(2))


@dataclass(frozen=True)
class Linear:
    """x = A (2 u - 1) + psi D (1 + c) + offset B + noise, and its archive's surrogate.

    With a `bend`, pours have psi times that of B besides, which neither the archive nor what was
    measured has.
    """

    slopes: Array
    direction: Array
    alien: Array
    bend: float = 0.0

    def pours(self, u: float, c: float, psi: float, count: int, seed: list[int]) -> Array:
        mean = (2 * u - 1) * self.slopes + (1 + c) * psi * self.direction
        mean = mean + self.bend * psi * self.alien
        noise = 0.3 * np.random.default_rng(seed).standard_normal((count, SIZE))
        return mean + noise

    def observe(self, psi: float, seed: int) -> list[ConditionPours]:
        straight = replace(self, bend=0.0)
        return [
            ConditionPours.of(f"{c:g}", [c], straight.pours(U, c, psi, POURS, [seed, i]))
            for i, c in enumerate(PLACES)
        ]

    def surrogate(self, offset: float) -> Surrogate:
        """Off by `offset` of the alien, which it does not know."""
        generator = np.random.default_rng(0)
        u, c, psi = generator.random(300), generator.random(300), np.zeros(300)
        psi[220:] = generator.random(80)
        rows = [self.pours(*row, 1, [7, i]) for i, row in enumerate(zip(u, c, psi, strict=True))]
        x = np.concatenate(rows) + offset * self.alien
        design = Design(("a",), ("height",), (Effect("first"),))
        return Surrogate.fit(design, u[:, None], c[:, None], psi[:, None], x, features=4)


@pytest.fixture(scope="module")
def linear() -> Linear:
    return Linear(*np.random.default_rng(3).standard_normal((3, SIZE)))


@pytest.fixture(scope="module")
def right(linear: Linear) -> Surrogate:
    return linear.surrogate(0.0)


@pytest.fixture(scope="module")
def wrong(linear: Linear) -> Surrogate:
    return linear.surrogate(1.0)


def settled(
    linear: Linear,
    surrogate: Surrogate,
    psi: float,
    number: int,
    monkeypatch: pytest.MonkeyPatch,
) -> tuple[Trace, Settled]:
    """What the fits say of measured pours, and what they say once the surrogate is held."""

    def both(_: Any, __: Any, condition: Any, found: Trace, seed: int) -> ModelPours:
        def of(one: Explanation) -> Array:
            strength = float(one.best_strengths.sum())
            place = PLACES.index(condition.at)
            u = float(one.theta[0])
            return linear.pours(u, condition.at, strength, FRESH, [100 + number, seed, place])

        base = of(found.base)
        return ModelPours(base, base if found.best is found.base else of(found.best))

    monkeypatch.setattr(module, "both", both)
    conditions = [SimpleNamespace(name=f"{c:g}", at=c, session="") for c in PLACES]
    task: Any = SimpleNamespace(of=lambda _: conditions)
    plan: Any = SimpleNamespace(unit=lambda at: np.array([at]))
    forward: Any = None
    analysis = Analysis(task, plan, forward, RULES, number, lambda _: None)
    observed = linear.observe(psi, number)
    found = trace(surrogate, observed, RULES, seed=number)
    return found, settle(analysis, surrogate, found, observed)


def test_a_right_surrogate_is_not_moved(
    linear: Linear, right: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = 0
    for number in range(SETS):
        found, after = settled(linear, right, 0.0, number, monkeypatch)
        moved += after.anchors > 0
        assert after.anchors or (after.trace is found and after.surrogate is right)
        assert after.before == after.anchors * FRESH * len(PLACES)
    # Each has a chance of 1 in 100.
    assert moved <= 2


def test_pours_at_the_fit_mend_a_wrong_surrogate(
    linear: Linear, wrong: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    alarms, kept, confirmed = 0, 0, 0
    for number in range(SETS):
        found, after = settled(linear, wrong, 0.0, number, monkeypatch)
        alarms += found.verdict.kind != "NONE"
        kept += after.trace.verdict.kind != "NONE"
        confirmed += after.confirmed > RULES.confirm
        assert 1 <= after.anchors <= ANCHORS
    assert alarms >= 0.8 * SETS
    assert kept <= 2 and confirmed >= SETS - 1


def test_an_effect_is_found_by_the_surrogate_that_is_held(
    linear: Linear, wrong: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    right_names, errors = 0, []
    for number in range(SETS):
        _, after = settled(linear, wrong, 0.6, number, monkeypatch)
        named = after.trace.verdict.named == ("first",)
        right_names += named
        if named:
            errors.append(float(after.trace.best.strengths[0]) - 0.6)
    assert right_names >= SETS - 2
    assert abs(np.mean(errors)) < 0.05


def test_a_gap_of_the_verdicts_model_is_not_the_bases(
    linear: Linear, right: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The base was held by the gap of a model far away: it was wrong there, and blanks alarmed."""
    bent, held, alarms = replace(linear, bend=1.0), 0, 0
    for number in range(SETS):
        _, after = settled(bent, right, 0.6, number, monkeypatch)
        held += after.anchors > 0
        base = after.trace.base_fit
        u = float(cube_from_normal(base.v)[0])
        blank = [
            ConditionPours.of(f"{c:g}", [c], linear.pours(u, c, 0.0, POURS, [800, number, i]))
            for i, c in enumerate(PLACES)
        ]
        alarms += trace(after.surrogate, blank, RULES, seed=number).verdict.kind != "NONE"
    assert held >= 0.8 * SETS
    assert alarms <= 2


def test_both_fits_are_held_as_often_as_it_takes(
    linear: Linear, right: Surrogate, monkeypatch: pytest.MonkeyPatch
) -> None:
    held: list[list[bool]] = []

    def hold(surrogate: Surrogate, fits: Any) -> Surrogate:
        held.append([bool(fit.active) for fit, _ in fits])
        return surrogate

    monkeypatch.setattr(module, "confirm", lambda *_: 0.0)
    monkeypatch.setattr(module, "anchored", hold)
    found, after = settled(linear, right, 0.6, 1, monkeypatch)
    assert found.verdict.named == ("first",) and after.anchors == ANCHORS
    assert held == [[False, True]] * ANCHORS


def test_an_anchor_is_right_at_its_fit_for_other_pours(linear: Linear, wrong: Surrogate) -> None:
    found = trace(wrong, linear.observe(0.0, 1), RULES)
    u = float(cube_from_normal(found.base_fit.v)[0])

    def fresh(seed: int) -> list[ConditionPours]:
        return [
            ConditionPours.of(f"{c:g}", [c], linear.pours(u, c, 0.0, FRESH, [900, seed, i]))
            for i, c in enumerate(PLACES)
        ]

    held = anchored(wrong, [(found.base_fit, fresh(0))])
    assert confirm(wrong, found.base_fit, fresh(1)) < 0.001
    p = [confirm(held, found.base_fit, fresh(i)) for i in range(1, 21)]
    assert np.mean(np.array(p) < 0.05) <= 0.2
    # A second anchor joins the first; both are gaps of the surrogate without any.
    again = anchored(held, [(found.base_fit, fresh(0))])
    assert again.anchor is not None and held.anchor is not None
    first, second = again.anchor.holds
    assert first is held.anchor.holds[0] and second.gaps == pytest.approx(first.gaps)
    assert replace(again, anchor=None).coefficients is wrong.coefficients
