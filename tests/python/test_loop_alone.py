"""What one condition alone leaves is told: its number may be recorded wrongly."""

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop.check.alone import of_alone
from granulcal.loop.effects.design import Design, Effect
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import trace

Array = NDArray[np.float64]

RULES = Thresholds(replicates=400, replicates_after=200, refits=4)
SIZE = 6
RANDOM = np.random.default_rng(2)
SLOPES, ALONG, DRAG = (RANDOM.standard_normal(shape) for shape in ((2, SIZE), SIZE, SIZE))
PLACES = (0.1, 0.5, 0.9)


def simulate(theta: Array, c: Array, psi: Array, generator: np.random.Generator) -> Array:
    """Statistics that are linear in two parameters and bend with the condition."""
    mean = (2 * theta - 1) @ SLOPES + 3 * c**2 * ALONG + 2 * psi * DRAG
    return mean + 0.2 * generator.standard_normal(mean.shape)


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    generator = np.random.default_rng(3)
    theta, c, psi = generator.random((460, 2)), generator.random((460, 1)), np.zeros((460, 1))
    psi[-100:, 0] = generator.random(100)
    x = simulate(theta, c, psi, generator)
    return Surrogate.fit(Design(("a", "b"), ("height",), (Effect("drag"),)), theta, c, psi, x)


def told(
    surrogate: Surrogate, poured: Sequence[float], psi: float = 0.0, stated: tuple[float, ...] = ()
) -> tuple[str, ...]:
    """What is said of pours at places that are stated otherwise."""
    generator, measured = np.random.default_rng(5), []
    for c, at in zip(stated or PLACES, poured, strict=True):
        rows = np.tile([0.4, 0.6], (3, 1)), np.full((3, 1), at), np.full((3, 1), psi)
        measured.append(ConditionPours.of(f"at {c:g}", [c], simulate(*rows, generator)))
    return of_alone(surrogate, measured, trace(surrogate, measured, RULES), RULES)


def test_a_condition_that_is_recorded_wrongly_is_told(surrogate: Surrogate) -> None:
    (one,) = told(surrogate, (0.1, 0.75, 0.9))
    assert "what is left is of at 0.5 alone: without it nothing is (p = " in one
    (one,) = told(surrogate, (0.1, 0.5, 0.7))
    assert "of at 0.9 alone" in one


def test_what_all_conditions_show_is_of_none_alone(surrogate: Surrogate) -> None:
    assert told(surrogate, PLACES) == ()
    assert told(surrogate, PLACES, psi=0.6) == ()
    # Of two conditions either may be wrong.
    assert told(surrogate, (0.1, 0.7), stated=(0.1, 0.9)) == ()
