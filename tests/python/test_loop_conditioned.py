"""Further pours that join a surrogate without a fit."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Surrogate
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.conditioned import conditioned

Array = NDArray[np.float64]

SIZE = 3


def pours(u: Array, c: Array, psi: Array, seed: int) -> Array:
    """Statistics that bend in u and c, and an effect that a quadratic follows."""
    along, effect = np.array([1.0, -0.5, 2.0]), np.array([0.3, 1.0, -0.4])
    mean = np.sin(4 * u * (1 + c))[:, None] * along + (psi * (1 + u))[:, None] * effect
    return mean + 0.2 * np.random.default_rng(seed).standard_normal((len(u), SIZE))


def rows(count: int, seed: int, share: float) -> Rows:
    """Pours over the whole prior; a share of them has the effect."""
    generator = np.random.default_rng([seed, 1])
    u, c = generator.random(count), generator.random(count)
    psi = np.where(generator.random(count) < share, generator.random(count), 0.0)
    return Rows(u[:, None], c[:, None], psi[:, None], pours(u, c, psi, seed))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """Of a small archive."""
    known = rows(160, 0, 0.3)
    design = Design(("a",), ("height",), (Effect("first"),))
    return Surrogate.fit(design, known.theta, known.condition, known.psi, known.x, features=12)


def test_it_is_the_posterior_of_all_pours(surrogate: Surrogate) -> None:
    # By precisions instead of covariances: A' = A + F^T S^-1 F.
    plain, more = replace(surrogate, lack=np.zeros(SIZE)), rows(40, 1, 0.5)
    found = conditioned(plain, more)
    features = plain.features(more.theta, more.condition, more.psi)
    scale = plain.scale(more.theta, more.condition, more.psi)
    y = plain.standardise(more.x) - more.psi * plain.effect_move(more.theta, more.condition, 0)
    for j, root in enumerate(plain.roots):
        weighted = features / scale[:, j, None] ** 2
        before = np.linalg.inv(root @ root.T)
        precision = before + weighted.T @ features
        mean = np.linalg.solve(precision, before @ plain.coefficients[j] + weighted.T @ y[:, j])
        assert found.coefficients[j] == pytest.approx(mean, abs=1e-6)
        covariance = found.roots[j] @ found.roots[j].T
        assert covariance == pytest.approx(np.linalg.inv(precision), abs=1e-8)


def test_two_halves_say_what_the_whole_does(surrogate: Surrogate) -> None:
    plain, more = replace(surrogate, lack=np.zeros(SIZE)), rows(40, 2, 0.5)
    half = np.arange(40) < 20
    once, twice = conditioned(plain, more), conditioned(plain, more.taken(half))
    twice = conditioned(twice, more.taken(~half))
    assert twice.coefficients == pytest.approx(once.coefficients, abs=1e-8)
    assert len(twice.rows) == len(once.rows) == 200 and twice.white.shape == (200, SIZE)


def test_it_is_nearer_to_the_truth_by_as_much_as_it_says(surrogate: Surrogate) -> None:
    # Far more pours than the archive has: errors fall, and those that are left are claimed.
    found = conditioned(surrogate, rows(600, 3, 0.5))
    at = rows(400, 4, 1.0)
    u, c, psi = at.theta[:, 0], at.condition[:, 0], at.psi[:, 0]
    noise = 0.2 * np.random.default_rng(4).standard_normal((400, SIZE))
    true = surrogate.standardise(pours(u, c, psi, 4) - noise)
    off = [true - one.mean(at.theta, at.condition, at.psi) for one in (surrogate, found)]
    before, after = (float(np.mean(one**2)) for one in off)
    features = found.features(at.theta, at.condition, at.psi)
    claimed = np.mean([(features @ root) ** 2 for root in found.roots]) * features.shape[1]
    assert after < 0.6 * before and 0.2 < after / claimed < 5


def test_near_pours_share_what_the_features_cannot_follow(surrogate: Surrogate) -> None:
    # Many pours of one place say no more of the coefficients than one that is known exactly.
    lacking = replace(surrogate, lack=np.full(SIZE, 0.5))
    place = np.full((200, 1), 0.5)
    many = Rows(place, place, 0 * place, pours(place[:, 0], place[:, 0], 0 * place[:, 0], 5))
    features = lacking.features(place[:1], place[:1], 0 * place[:1])
    scale = lacking.scale(place[:1], place[:1], 0 * place[:1])
    for j, root in enumerate(conditioned(lacking, many).roots):
        prior = float(np.sum((features @ lacking.roots[j]) ** 2))
        shared = 0.5 * float(scale[0, j]) ** 2
        exact = 1 / (1 / prior + 1 / (shared + float(scale[0, j]) ** 2 / 200))
        assert float(np.sum((features @ root) ** 2)) == pytest.approx(exact, rel=1e-6)


def test_pours_with_a_statistic_missing_are_left_out(surrogate: Surrogate) -> None:
    more = rows(10, 6, 0.5)
    more.x[3, 1] = np.nan
    found = conditioned(surrogate, more)
    assert len(found.rows) == len(surrogate.rows) + 9
    more.x[:] = np.nan
    assert conditioned(surrogate, more) is surrogate
