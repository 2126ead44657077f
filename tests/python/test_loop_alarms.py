"""What speaks against a verdict without taking it away."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.check.alarms import (
    of_base_fit,
    of_ends,
    of_error,
    of_exchange,
    of_labels,
    of_left,
    of_placebo,
    of_untried,
)
from granulcal.loop.condition import Condition
from granulcal.loop.effects.library import by_name
from granulcal.loop.effects.untried import untried
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import Verdict
from granulcal.pours.scene import Scene

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
    # What does not fall by chance grows by none, and what was nothing cannot fall.
    before, after = error(0.5, 0.2).total_before, error(0.5, 0.55).total_after
    flat = cast(Any, SimpleNamespace(total_before=before, total_after=after, is_worse=False))
    (told,) = of_error(NAMED, flat, better)
    assert "at the fitted conditions is no less than without" in told
    nothing = SimpleNamespace(square=-0.1)
    nil = cast(Any, SimpleNamespace(total_before=nothing, total_after=after, is_worse=False))
    assert of_error(NAMED, nil, better) == ()
    # Where nothing is named both models are one.
    assert of_error(NONE, worse, worse) == ()


def test_a_name_is_told_where_the_base_models_fit_is_not_its_best() -> None:
    rules = Thresholds()
    (told,) = of_base_fit(NAMED, 2.5e-4, rules)
    assert "p = 0.00025" in told and "may be less" in told
    assert of_base_fit(NAMED, 0.4, rules) == of_base_fit(NONE, 2.5e-4, rules) == ()
    # Too few usable pours of the base model tell nothing.
    assert of_base_fit(NAMED, float("nan"), rules) == ()


def test_an_error_that_is_left_of_an_explanation_is_said() -> None:
    left, gone = error(1.0, 0.5), error(1.0, 0.0)
    assert of_left(NAMED, gone, None) == ()
    for verdict in (NAMED, NONE):
        (told,) = of_left(verdict, left, gone)
        assert "is left at there (fitted): 0.9" in told and "sealed" not in told
        assert "there (sealed)" in of_left(verdict, gone, left)[0]
    assert of_left(Verdict("UNEXPLAINED", (), (), 1e-3, ""), left, left) == ()


def test_what_is_left_where_a_name_was_taken_back_is_of_the_base_model() -> None:
    # The fits named an effect whose model leaves nothing; NONE is said of the base model.
    (told,) = of_left(NONE, error(1.0, 0.0), None, is_taken_back=True)
    assert "D² of the base model is left at there (fitted): 4" in told
    assert of_left(NONE, error(0.0, 1.0), None, is_taken_back=True) == ()


def test_what_was_not_tried_is_said_beside_a_fault_of_the_image() -> None:
    scene = Scene.funnel(height=0.1)
    tried = by_name(["camera.offset", "drag", "height"])
    others = untried(scene, tried, ("funnel.height",))
    names = [effect.name for effect in others]
    assert "clump" in names and "ground.layer" in names
    # Tried, stated by a condition, of what is seen, or without anything to act on in the scene.
    absent = {"drag", "fluid.viscosity", "height", "camera.blur", "clock.offset"}
    assert not absent & set(names) and "liquid.permeability" not in names
    offset = Verdict("EFFECT", ("camera.offset",), ("camera.offset",), 5e-4, "21 nat")
    (told,) = of_untried(offset, others)
    assert told.startswith("camera.offset is how the grains were seen") and "clump" in told
    assert of_untried(offset, ()) == of_untried(NAMED, others) == of_untried(NONE, others) == ()


def test_an_alarm_of_the_placebo_is_said_with_its_own_word() -> None:
    rules = Thresholds()
    assert of_placebo(NONE, rules) == ()
    (told,) = of_placebo(NAMED, rules)
    assert "says SET (p = 0.0005; 70 nat)" in told


def test_a_strength_at_the_end_of_its_range_is_said_to_lie_there() -> None:
    task = cast(Any, SimpleNamespace(effect=lambda name: by_name([name])[0]))

    def best(at_end: bool, strength: float) -> Any:
        return SimpleNamespace(
            effects=("polydispersity",), best_strengths=np.array([strength]), at_end=at_end
        )

    named = Verdict("EFFECT", ("polydispersity",), ("polydispersity",), 5e-4, "260 nat")
    (told,) = of_ends(named, best(True, 0.999), task)
    assert "polydispersity is found at 0.22, the end of what the library has of it" in told
    assert of_ends(named, best(False, 0.5), task) == ()
    # It leans on the end at which it is off.
    assert of_ends(named, best(True, 0.01), task) == ()
    assert of_ends(NONE, best(True, 0.999), task) == ()


def test_recordings_of_other_conditions_are_told() -> None:
    def pours(level: float, seed: int, count: int) -> NDArray[np.float64]:
        return level + 0.1 * np.random.default_rng(seed).standard_normal((count, 3))

    base = {name: pours(level, 9, 10) for name, level in (("2", 0.0), ("4", 1.0), ("6", 2.0))}
    right = {name: pours(level, 5, 3) for name, level in (("2", 0.0), ("4", 1.0), ("6", 2.0))}
    # An effect is no exchange.
    off = {name: rows + 0.4 for name, rows in right.items()}
    spread = np.ones(2)
    assert of_labels(right, base, spread) == of_labels(off, base, spread) == ()
    swapped = {"2": right["6"], "4": right["4"], "6": right["2"]}
    (told,) = of_labels(swapped, base, spread)
    assert "those of 2 like pours of 6, those of 6 like pours of 2" in told and "of 4" not in told


def test_a_sealed_condition_that_was_exchanged_with_a_fitted_one_is_told() -> None:
    """The fits follow the wrong label, so that the error is at the sealed one alone."""

    def pours(level: float, seed: int, count: int) -> NDArray[np.float64]:
        return level + 0.1 * np.random.default_rng(seed).standard_normal((count, 3))

    def condition(name: str, use: str, **known: float) -> Condition:
        return Condition(name, {"start.height": float(name[0])}, use, (Path(name),), known=known)

    fitted = condition("2", "fit"), condition("4", "fit")
    base = {name: pours(level, 9, 10) for name, level in (("2", 0.0), ("4", 1.6), ("6", 3.0))}
    swapped = {"2": pours(0.0, 5, 3), "4": pours(2.0, 6, 3), "6": pours(1.2, 7, 3)}
    every, spread = (*fitted, condition("6", "sealed")), np.ones(2)
    none, left = error(0.0, 0.0), error(1.0, 1.0)
    (told,) = of_exchange(every, swapped, base, spread, (none, left))
    assert "those of 4 like pours of 6, those of 6 like pours of 4" in told
    assert of_exchange(every, swapped, base, spread, (none, none)) == ()
    assert of_exchange(every, swapped, base, spread, (none, None)) == ()
    # Another day of the same numbers is nothing to be exchanged with.
    again = {**base, "2 again": base["4"]}, {**swapped, "2 again": swapped["4"]}
    days = (*fitted, condition("2 again", "sealed"))
    assert of_exchange(days, again[1], again[0], spread, (none, left)) == ()
