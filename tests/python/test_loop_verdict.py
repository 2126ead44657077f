"""From p-values and evidences to a word: no effect is a rival like any other."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from granulcal.loop import Design, Effect
from granulcal.loop.closed import Closed
from granulcal.loop.effects.library import by_name
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.test.refit import Model
from granulcal.loop.test.residual_test import ResidualTest
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Explanation, Trace
from granulcal.loop.test.verdict import Verdict, decide

RULES = Thresholds()
DESIGN = Design(("mu",), ("height",), (Effect("drag"), Effect("tilt"), Effect("count")))


def residual_of(p: float) -> ResidualTest:
    """Returns a residual test of which only p is asked."""
    none = np.empty(0)
    return ResidualTest(p, p, p, p, 0.0, 0.0, 0.0, np.ones(3), (), none, none, none)


def model(log_probability: float, *effects: int) -> Model:
    """Returns a model of which only its effects and its probability are asked."""
    none = np.empty(0)
    fit = cast(Fit, None)
    return Model(effects, fit, log_probability, log_probability, none, none, False, none)


def word(*models: tuple[Model, float], p: float = 0.001) -> Verdict:
    """Returns the verdict where no effect has the log probability 0."""
    return decide(DESIGN, residual_of(p), model(0.0), list(models), RULES)


@pytest.mark.parametrize(
    ("gain", "kind"), [(-1.0, "RESIDUAL"), (2.9, "RESIDUAL"), (3.1, "EFFECT"), (40.0, "EFFECT")]
)
def test_a_name_is_as_far_from_no_effect_as_from_a_rival(gain: float, kind: str) -> None:
    found = word((model(gain, 0), 0.5), (model(gain - 9.0, 1), 0.5))
    assert found.kind == kind
    assert found.named == (("drag",) if kind == "EFFECT" else ())
    if kind == "RESIDUAL":
        assert "3 asked" in found.reason


def test_rivals_within_reach_are_named_together_the_best_first() -> None:
    found = word((model(7.0, 0), 0.5), (model(8.0, 1), 0.5), (model(4.0, 2), 0.5))
    assert (found.kind, found.named) == ("SET", ("tilt", "drag"))


def test_a_pair_that_is_best_is_named_whole() -> None:
    assert word((model(9.0, 0, 2), 0.5), (model(8.0, 1), 0.5)).kind == "EFFECTS"


def test_of_a_pair_the_one_that_explains_more_alone_comes_first() -> None:
    alone = (model(2.0, 0), 0.001), (model(5.0, 2), 0.001)
    assert word((model(12.0, 0, 2), 0.5), *alone).named == ("count", "drag")
    assert word((model(12.0, 0, 2), 0.5)).named == ("drag", "count")


def test_what_leaves_something_is_no_explanation() -> None:
    assert word((model(30.0, 0), 0.01), (model(5.0, 1), 0.5)).named == ("tilt",)
    assert word((model(30.0, 0), 0.01)).kind == "UNEXPLAINED"


@pytest.mark.parametrize(("p", "kind"), [(0.06, "NONE"), (0.04, "RESIDUAL")])
def test_what_is_not_rejected_has_no_name(p: float, kind: str) -> None:
    assert word((model(30.0, 0), 0.5), p=p).kind == kind


def test_a_second_effect_is_told_from_none_as_a_first_one_is() -> None:
    left = (model(20.0, 2), 0.005), (model(4.0, 0), 0.001)
    # What the first one leaves is no evidence of a second one that explains nothing.
    found = word((model(22.9, 0, 2), 0.5), *left)
    assert (found.kind, found.named) == ("EFFECT", ("count",)) and "20.0 nat" in found.reason
    assert word((model(23.1, 0, 2), 0.5), *left).named == ("count", "drag")
    # A rival of the member that leaves nothing is named beside it.
    found = word((model(22.0, 0, 2), 0.5), *left, (model(18.0, 1), 0.5))
    assert (found.kind, found.named) == ("SET", ("count", "tilt"))


@pytest.mark.parametrize(("alone", "kind"), [(1.0, "RESIDUAL"), (3.1, "EFFECT")])
def test_a_member_that_a_pair_gives_way_to_is_told_from_no_effect(alone: float, kind: str) -> None:
    # Neither of the two is told from the next: pair, member, none.
    members = (model(alone, 0), 0.001), (model(0.5, 2), 0.001)
    found = word((model(alone + 2.5, 0, 2), 0.5), *members)
    assert found.kind == kind and found.named == (("drag",) if kind == "EFFECT" else ())
    if kind == "RESIDUAL":
        assert "the best effect is not told from none: 1.0 nat" in found.reason


def explained(*of: tuple[tuple[str, ...], float, float]) -> tuple[Explanation, ...]:
    """Explanations by effects, log probability and the strength of each effect."""
    return tuple(
        Explanation(
            effects=names,
            theta=np.empty(0),
            strengths=np.full(len(names), strength),
            intervals=np.tile([strength - 0.1, strength + 0.1], (len(names), 1)),
            best_strengths=np.full(len(names), strength),
            log_probability=log_probability,
            p_after=0.5,
            at_end=False,
        )
        for names, log_probability, strength in of
    )


def test_the_strength_of_a_name_is_not_that_of_a_pair_that_gave_way() -> None:
    # None alone is adequate, and the pair is no 3 nat above the better of its members.
    found = word((model(22.0, 0, 2), 0.5), (model(20.0, 0), 0.001), (model(5.0, 2), 0.001))
    assert (found.kind, found.named) == ("EFFECT", ("drag",))
    explanations = explained((("drag", "count"), 22.0, 0.3), (("drag",), 20.0, 0.6))
    trace = SimpleNamespace(verdict=found, explanations=explanations, best=explanations[1])
    own = SimpleNamespace(strengths=np.array([0.65]), intervals=np.array([[0.6, 0.7]]))
    closed = SimpleNamespace(
        trace=trace,
        standing=SimpleNamespace(own=own),
        calibrated=None,
        task=SimpleNamespace(effect=lambda name: by_name([name])[0]),
    )
    full = by_name(["drag"])[0].full
    strengths = Closed.strengths(cast(Any, closed))
    assert strengths["drag"] == pytest.approx((0.6 * full, 0.65 * full, 0.7 * full))
    # By fits alone as well.
    closed.standing.own = None
    strengths = Closed.strengths(cast(Any, closed))
    assert strengths["drag"] == pytest.approx((0.5 * full, 0.6 * full, 0.7 * full))


def test_the_model_of_a_set_is_one_of_its_members() -> None:
    singles = (model(20.0, 1), 0.001), (model(16.5, 0), 0.5), (model(16.0, 2), 0.5)
    found = word((model(18.0, 0, 2), 0.5), *singles)
    assert (found.kind, found.named) == ("SET", ("drag", "count"))
    explanations = explained((("drag", "count"), 18.0, 0.3), (("drag",), 16.5, 0.6))
    trace = SimpleNamespace(verdict=found, explanations=explanations, base=None)
    best = cast(property, Trace.best).fget
    assert best is not None and best(trace) is explanations[1]
