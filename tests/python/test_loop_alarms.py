"""What speaks against a verdict without taking it away."""

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.check.alarms import of_error, of_left, of_placebo
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import Verdict

NAMED = Verdict("SET", ("cohesion.dry", "bonds"), ("cohesion", "bonds"), 5e-4, "70 nat")
NONE = Verdict("NONE", (), (), 0.8, "nothing is left")


def error(before: float, after: float) -> Improvement:
    """Pours that are off by so much in each of four statistics."""

    def pours(off: float, seed: int) -> NDArray[np.float64]:
        return off + 0.1 * np.random.default_rng(seed).standard_normal((10, 4))

    measured, first, second = pours(0.0, 1), pours(before, 2), pours(after, 3)
    return compare(["there"], [measured], [first], [second], np.ones(4), seed=0)


def test_a_name_with_which_the_error_grows_is_said_to() -> None:
    better, worse = error(1.0, 0.2), error(0.5, 2.0)
    assert of_error(NAMED, better, better) == of_error(NAMED, better, None) == ()
    (told,) = of_error(NAMED, better, worse)
    assert "with cohesion.dry, bonds the error" in told
    assert "at the sealed conditions from 0.99" in told and "fitted" not in told
    (told,) = of_error(NAMED, worse, worse)
    assert "at the fitted conditions from" in told and "and at the sealed conditions" in told
    # Where nothing is named both models are one.
    assert of_error(NONE, worse, worse) == ()


def test_an_error_that_is_left_of_an_explanation_is_said() -> None:
    left, gone = error(1.0, 0.5), error(1.0, 0.0)
    assert of_left(NAMED, gone, None) == ()
    for verdict in (NAMED, NONE):
        (told,) = of_left(verdict, left, gone)
        assert "is left at there (fitted): 0.9" in told and "sealed" not in told
        assert "there (sealed)" in of_left(verdict, gone, left)[0]
    assert of_left(Verdict("UNEXPLAINED", (), (), 1e-3, ""), left, left) == ()


def test_an_alarm_of_the_placebo_is_said_with_its_own_word() -> None:
    rules = Thresholds()
    assert of_placebo(NONE, rules) == ()
    (told,) = of_placebo(NAMED, rules)
    assert "says SET (p = 0.0005; 70 nat)" in told
