"""What two effects do together, in the surrogate and in the search for a model."""

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Design, Effect, Surrogate, Thresholds, trace
from granulcal.loop.surrogate.columns import crossed_effects
from granulcal.loop.surrogate.linearised import LinearisedSurrogate

Array = NDArray[np.float64]

SIZE, NOISE = 6, 0.3
PLACES = (0.0, 0.5, 1.0)
DESIGN = Design(("a",), ("height",), tuple(Effect(name) for name in ("one", "two", "three")))
ALONG, *DIRECTIONS, TOGETHER = np.random.default_rng(5).standard_normal((5, SIZE))


def mean(u: Array, c: Array, psi: Array) -> Array:
    """The second effect turns most of the first one round."""
    product = psi[:, 0] * psi[:, 1] * (1 + 0.5 * c)
    return (2 * u - 1)[:, None] * ALONG + psi @ np.array(DIRECTIONS) + product[:, None] * TOGETHER


def fitted(together: int) -> Surrogate:
    """Of 240 plain pours, 60 of each effect, and so many with the first two at once."""
    generator = np.random.default_rng(1)
    psi = np.zeros((420 + together, 3))
    for k in range(3):
        psi[240 + 60 * k : 300 + 60 * k, k] = generator.random(60)
    psi[420:, :2] = generator.random((together, 2))
    u, c = generator.random((2, len(psi)))
    x = mean(u, c, psi) + NOISE * generator.standard_normal((len(psi), SIZE))
    return Surrogate.fit(DESIGN, u[:, None], c[:, None], psi, x, features=4)


@pytest.fixture(scope="module")
def apart() -> Surrogate:
    return fitted(0)


@pytest.fixture(scope="module")
def crossed() -> Surrogate:
    return fitted(40)


def test_two_effects_count_together_where_enough_rows_have_both() -> None:
    psi = np.zeros((9, 4))
    psi[:4, [0, 2]] = 0.5
    psi[4:7, [1, 3]] = -0.5
    psi[7:, 3] = 1.0
    assert crossed_effects(psi) == ((0, 2),)
    assert crossed_effects(np.eye(4)) == ()


def test_what_two_effects_do_together_is_learnt(apart: Surrogate, crossed: Surrogate) -> None:
    assert (apart.crossed, crossed.crossed) == ((), ((0, 1),))
    generator = np.random.default_rng(2)
    u, c = generator.random((2, 300))
    psi = np.column_stack([generator.random((300, 2)), np.zeros(300)])
    off = {}
    for name, one in (("apart", apart), ("crossed", crossed)):
        true = one.standardise(mean(u, c, psi))
        gap = true - one.mean(u[:, None], c[:, None], psi)
        features = one.features(u[:, None], c[:, None], psi)
        claimed = np.mean([np.sum((features @ root) ** 2, axis=1) for root in one.roots])
        off[name] = float(np.mean(gap**2)), float(claimed)
    assert off["crossed"][0] < 0.1 * off["apart"][0]
    # Its own error is what it says, within a factor.
    assert 0.2 < off["crossed"][0] / off["crossed"][1] < 5
    # One effect alone is as it was.
    psi[:, 1] = 0.0
    gap = crossed.standardise(mean(u, c, psi)) - crossed.mean(u[:, None], c[:, None], psi)
    assert float(np.mean(gap**2)) < 0.1


@pytest.mark.parametrize("strengths", [(0.0, 0.0, 0.4), (0.6, 0.5, 0.0), (0.6, 0.5, 0.3)])
def test_the_uncertainty_is_that_of_the_features(
    crossed: Surrogate, strengths: tuple[float, ...]
) -> None:
    psi = np.array(strengths)
    c = np.array(PLACES)[:, None]
    local = LinearisedSurrogate.at(crossed, c, np.ones(3), np.zeros(1))
    u, rows = np.full((3, 1), 0.5), np.tile(psi, (3, 1))
    features = crossed.features(u, c, rows)
    expected = np.stack([features @ root for root in crossed.roots], axis=1)
    np.testing.assert_allclose(local.error_root(psi), expected, atol=1e-10)
    np.testing.assert_allclose(
        local.mean(np.zeros(1), psi), crossed.mean(u, c, rows).ravel(), atol=1e-10
    )


def test_a_pair_whose_members_hide_each_other_is_named() -> None:
    # The third effect explains most by itself, and the first one least.
    surrogate = fitted(200)
    rules = Thresholds(replicates=300, replicates_after=100, refits=4)
    right = 0
    for number in range(6):
        generator = np.random.default_rng([number, 9])
        observed = []
        for c in PLACES:
            u, at, psi = np.full(5, 0.4), np.full(5, c), np.tile([0.8, 0.8, 0.0], (5, 1))
            x = mean(u, at, psi) + NOISE * generator.standard_normal((5, SIZE))
            observed.append(ConditionPours.of(f"{c:g}", [c], x))
        found = trace(surrogate, observed, rules, seed=number)
        alone = [one.effects for one in found.explanations if len(one.effects) == 1]
        assert alone == [("three",), ("two",), ("one",)]
        verdict = found.verdict
        right += verdict.kind == "EFFECTS" and set(verdict.named) == {"one", "two"}
    assert right >= 5
