"""From which strength on an effect is seen in 80 %."""

from collections.abc import Callable
from statistics import NormalDist

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Surrogate, power
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.test.detectable import STRENGTHS, detectable
from granulcal.loop.test.score import Scores
from granulcal.loop.test.trace import fit_at

Array = NDArray[np.float64]

# Standard deviations at which one effect of one sign is seen in 80 %.
NEEDED = NormalDist().inv_cdf(0.95) + NormalDist().inv_cdf(0.8)


def seen(*materials: list[float]) -> float:
    """The strength of one effect whose distances at STRENGTHS are these."""
    return float(detectable(np.array(materials)[:, None, None], np.array([False]))[0])


def test_an_effect_is_seen_from_where_it_stays_in_sight() -> None:
    straight = list(NEEDED * STRENGTHS / 0.3)
    assert seen(straight) == pytest.approx(0.3, rel=0.05)
    # Parameters that hide it at half its strength and nowhere else.
    assert seen([*straight[:3], 0.0, straight[4]]) > 0.6
    # Beyond its full strength as from there on, or never.
    assert seen(list(NEEDED * STRENGTHS / 3)) == pytest.approx(3, rel=0.05)
    assert seen([0.0] * len(STRENGTHS)) == np.inf


def test_half_of_the_materials_are_not_80_percent() -> None:
    hidden, plain = list(NEEDED * STRENGTHS / 0.8), list(NEEDED * STRENGTHS / 0.1)
    assert seen(plain) < 0.11 and seen(plain, hidden) > 0.5


def test_two_signs_and_more_effects_ask_for_more() -> None:
    row: Array = np.tile(NEEDED * STRENGTHS / 0.3, (1, 2, 2, 1)).astype(np.float64)
    one, both = detectable(row, np.array([False, True]))
    assert 0.3 < one < both < 0.5


def strengths(move: Callable[[Array], Array]) -> tuple[float, float]:
    """From where on an effect is seen, by refits and by the slopes: an effect `move`s a = 2 u - 1.

    Statistics are 3 a, 3 a^2 and one of noise alone.
    """
    generator = np.random.default_rng(3)
    theta, c = generator.random((800, 1)), generator.random((800, 1))
    psi = np.zeros((800, 1))
    psi[400:, 0] = generator.random(400)
    x = move(np.column_stack([2 * theta[:, 0] - 1, psi[:, 0]]))
    x = x + 0.3 * generator.standard_normal(x.shape)
    known = Surrogate.fit(Design(("a",), ("c",), (Effect("e"),)), theta, c, psi, x, features=8)
    at, counts, v = np.array([[0.0], [1.0]]), np.array([3.0, 3.0]), np.zeros(1)
    local = LinearisedSurrogate.at(known, at, counts, v)
    scores = Scores.of(local, fit_at(local, v), known.design.candidates)
    by_slopes = NEEDED / np.sqrt(scores.information[0, 0])
    return float(power(known, [0.5], at, counts).detectable[0]), float(by_slopes)


def test_what_no_parameter_bends_after_is_seen_as_its_slope_says() -> None:
    by_refits, by_slopes = strengths(
        lambda at: np.column_stack([3 * at[:, 0], 3 * at[:, 0] ** 2, 2 * at[:, 1]])
    )
    assert by_refits == pytest.approx(by_slopes, rel=0.15)


def test_what_a_parameter_bends_after_is_hidden() -> None:
    def along(at: Array) -> Array:
        moved = at.sum(axis=1)
        return np.column_stack([3 * moved, 3 * moved**2, 0 * moved])

    by_refits, by_slopes = strengths(along)
    assert by_refits > 2 * by_slopes
