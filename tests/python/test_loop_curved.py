"""What an effect does along its strength, where many pours show it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Surrogate
from granulcal.loop.surrogate import columns
from granulcal.loop.surrogate.columns import (
    CURVES,
    curve_columns,
    curve_width,
    curved_columns,
    curved_effects,
    fold_curve,
)
from granulcal.loop.surrogate.linearised import FAINT, PLAIN, LinearisedSurrogate
from granulcal.loop.test.score import Scores
from granulcal.loop.test.trace import fit_at

Array = NDArray[np.float64]

SIZE, NOISE, BASE = 6, 0.3, 240
DESIGN = Design(("a",), ("height",), (Effect("sight"), Effect("drag")))
ALONG, SIGHT, DRAG = np.random.default_rng(5).standard_normal((3, SIZE))


def mean(u: Array, psi: Array) -> Array:
    """The first effect does nothing until an edge comes across the threshold, nearly at once."""
    rise = 1 / (1 + np.exp(-(psi[:, 0] - 0.2) / 0.03))
    return (2 * u - 1)[:, None] * ALONG + rise[:, None] * SIGHT + psi[:, 1:] * DRAG


def fitted(count: int, design: Design = DESIGN) -> Surrogate:
    """Of plain pours, of so many of the first effect, and of a few of the second."""
    generator = np.random.default_rng(1)
    psi = np.zeros((BASE + count + 60, 2))
    psi[BASE : BASE + count, 0] = generator.random(count)
    psi[BASE + count :, 1] = generator.random(60)
    u, c = generator.random((2, len(psi)))
    x = mean(u, psi) + NOISE * generator.standard_normal((len(psi), SIZE))
    return Surrogate.fit(design, u[:, None], c[:, None], psi, x, features=4)


@pytest.fixture(scope="module")
def curved() -> Surrogate:
    return fitted(300)


def test_a_curve_is_nothing_at_both_ends() -> None:
    for is_two_sided in (False, True):
        ends = curve_columns(np.array([-1.0, 0.0, 1.0]), is_two_sided)
        assert ends.shape == (3, CURVES) and np.abs(ends).max() < 1e-12
    # Either side has its own.
    one, other = curve_columns(np.array([0.3, -0.3]), True)
    assert one @ other == 0 and np.abs(one).max() > 0.1


@pytest.mark.parametrize("is_two_sided", [False, True])
def test_what_goes_with_the_coordinates_folds_into_the_sines(is_two_sided: bool) -> None:
    generator = np.random.default_rng(7)
    u, columns = generator.random((5, 3)), generator.standard_normal((curve_width(3), 2))
    for strength in (-0.4, 0.0, 0.3):
        plain = curved_columns(np.full(5, strength), u, is_two_sided) @ columns
        sines = curve_columns(np.array(strength), is_two_sided)
        folded = np.tensordot(sines, fold_curve(columns, u, is_two_sided), axes=1)
        np.testing.assert_allclose(folded, plain, atol=1e-12)
    # In the middle of all coordinates it is the curve alone.
    middle = fold_curve(columns, np.full((1, 3), 0.5), is_two_sided)[:, 0]
    np.testing.assert_allclose(middle, columns[:CURVES], atol=1e-12)


def test_a_step_that_grows_with_a_coordinate_is_learnt() -> None:
    generator = np.random.default_rng(8)
    design = Design(("a",), ("height",), (Effect("sight"),))
    psi = np.zeros((BASE + 400, 1))
    psi[BASE:, 0] = generator.random(400)
    u, c = generator.random((2, len(psi)))

    def true(u: Array, psi: Array) -> Array:
        rise = 1 / (1 + np.exp(-(psi[:, 0] - 0.2) / 0.03))
        return (2 * u - 1)[:, None] * ALONG + 6 * (u * rise)[:, None] * SIGHT

    x = true(u, psi) + NOISE * generator.standard_normal((len(psi), SIZE))
    one = Surrogate.fit(design, u[:, None], c[:, None], psi, x, features=4)
    at = np.tile([0.1, 0.15, 0.2, 0.25, 0.3], 2)[:, None]
    where = np.repeat([0.1, 0.9], 5)
    middle = np.full((10, 1), 0.5)
    gap = one.standardise(true(where, at)) - one.mean(where[:, None], middle, at)
    # By the curve of the middle it would be off by 40 % of the step, some 8 of these units.
    assert float(np.sqrt(np.mean(gap**2))) < 0.8


def test_effects_of_many_rows_have_a_curve() -> None:
    kinds = (
        Effect("seen"),
        Effect("few"),
        Effect("both", is_two_sided=True),
        Effect("size", held=-1),
    )
    psi = np.full((350, 4), 0.5)
    psi[100:, 1] = 0.0
    assert curved_effects(Design(("a",), (), kinds), psi) == ((0, False), (2, True))


def test_a_step_along_a_strength_is_learnt(curved: Surrogate) -> None:
    assert (fitted(150).curved, curved.curved) == ((), ((0, False),))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(columns, "_CURVED_ROWS", 1000)
        parabola = fitted(300)
    generator = np.random.default_rng(2)
    u, c, strength = generator.random((3, 300))
    psi = np.column_stack([0.4 * strength, np.zeros(300)])
    off = {}
    for one in (parabola, curved):
        gap = one.standardise(mean(u, psi)) - one.mean(u[:, None], c[:, None], psi)
        features = one.features(u[:, None], c[:, None], psi)
        claimed = np.mean([np.sum((features @ root) ** 2, axis=1) for root in one.roots])
        off[one.curved] = float(np.mean(gap**2)), float(claimed)
    (plain, sure), (found, claimed) = off[()], off[curved.curved]
    # A parabola is far off and does not know it.
    assert found < 0.1 * plain and plain > 10 * sure
    assert 0.2 < found / claimed < 5


@pytest.mark.parametrize("strengths", [(0.0, 0.4), (0.17, 0.0), (0.6, 0.3)])
def test_the_uncertainty_is_that_of_the_features(
    curved: Surrogate, strengths: tuple[float, ...]
) -> None:
    psi, c = np.array(strengths), np.array([[0.0], [0.5], [1.0]])
    local = LinearisedSurrogate.at(curved, c, np.ones(3), np.zeros(1))
    u, rows = np.full((3, 1), 0.5), np.tile(psi, (3, 1))
    features = curved.features(u, c, rows)
    expected = np.stack([features @ root for root in curved.roots], axis=1)
    np.testing.assert_allclose(local.error_root(psi), expected, atol=1e-10)
    found = local.mean(np.zeros(1), psi)
    np.testing.assert_allclose(found, curved.mean(u, c, rows).ravel(), atol=1e-10)
    if not psi[1]:
        there = curved.features(u, c, np.tile([FAINT, 0.0], (3, 1)))
        chord = (there - curved.features(u, c, np.zeros((3, 2)))) / FAINT
        variance = np.stack([np.sum((chord @ root) ** 2, axis=1) for root in curved.roots], axis=1)
        shift = local.shift_roots[0]
        of_shift = np.sum(shift**2, axis=1)
        found = np.diag(local.direction_error(0)) - of_shift
        np.testing.assert_allclose(found, variance.ravel(), atol=1e-10)


def test_a_corner_at_0_is_learnt() -> None:
    # As an offset has: below 0 alone it takes pixels below the threshold.
    design = Design(("a",), (), (Effect("offset", is_two_sided=True),))
    generator = np.random.default_rng(3)
    psi = np.zeros((640, 1))
    psi[BASE:, 0] = generator.uniform(-1, 1, 400)
    u = generator.random(640)

    def true(u: Array, psi: Array) -> Array:
        return (2 * u - 1)[:, None] * ALONG + 6 * np.minimum(psi, 0.0) * SIGHT

    x = true(u, psi) + NOISE * generator.standard_normal((640, SIZE))
    none = np.empty((640, 0))
    one = Surrogate.fit(design, u[:, None], none, psi, x, features=4)
    at, middle = np.array([[-0.2], [-0.1], [0.1], [0.2]]), np.full(4, 0.5)
    gap = one.standardise(true(middle, at)) - one.mean(middle[:, None], none[:4], at)
    assert float(np.mean(gap**2)) < 0.15
    local = LinearisedSurrogate.at(one, np.empty((1, 0)), np.ones(1), np.zeros(1))
    ends = one.features(middle[:2, None], none[:2], np.array([[0.25], [-0.25]]))
    variance = [np.sum((2 * (ends[0] - ends[1]) @ root) ** 2) for root in one.roots]
    of_shift = np.sum(local.shift_roots[0] ** 2, axis=1)
    np.testing.assert_allclose(np.diag(local.direction_error(0)) - of_shift, variance, atol=1e-10)


def test_what_bends_is_looked_for_where_it_is_hardly_seen() -> None:
    # As a drag does: what it does at a quarter of its range is the less the farther it goes.
    design = Design(("a",), (), (Effect("drag"),))
    generator = np.random.default_rng(3)
    psi = np.zeros((640, 1))
    psi[BASE:, 0] = generator.random(400)
    u = generator.random(640)

    def true(u: Array, psi: Array) -> Array:
        first = 16 * psi * np.maximum(0.5 - psi, 0.0)
        return (2 * u - 1)[:, None] * ALONG + 3 * (first * SIGHT + psi * DRAG)

    x = true(u, psi) + NOISE * generator.standard_normal((640, SIZE))
    none = np.empty((640, 0))
    one = Surrogate.fit(design, u[:, None], none, psi, x, features=4)
    local = LinearisedSurrogate.at(one, np.empty((1, 0)), np.ones(1), np.zeros(1))
    scores = Scores.of(local, fit_at(local, np.zeros(1)), (0,))
    of_stronger = replace(scores, directions=scores.stronger)
    base = local.mean(np.zeros(1), np.zeros(1))
    for strength, is_along_stronger in ((FAINT, False), (PLAIN, True)):
        moved = local.mean(np.zeros(1), np.array([strength])) - base
        left = scores.remain((scores.whiten @ moved)[:, None])
        whole = float(np.sum(left**2))
        # Nothing of it is lost along its own chord.
        assert scores.squares(left)[0, 0] == pytest.approx(whole, rel=0.02)
        along_stronger = of_stronger.squares(left)[0, 0]
        assert (along_stronger > 0.98 * whole) == is_along_stronger
        if not is_along_stronger:
            assert along_stronger < 0.7 * whole
