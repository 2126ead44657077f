"""Readings of one pour share its noise."""

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Surrogate
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.blocks import fit_blocks
from granulcal.loop.surrogate.readings import Readings

Array = NDArray[np.float64]

SIZE, BASE, SEEN = 5, 160, 80
DESIGN = Design(("a",), ("height",), tuple(Effect(name) for name in "pqrst"))
ALONG = np.random.default_rng(5).standard_normal((1 + len(DESIGN.effects), SIZE))


@pytest.mark.parametrize("rho", [0.0, 0.4, 0.9])
def test_rows_apart_are_independent(rho: float) -> None:
    pour = np.random.default_rng(0).integers(0, 30, 80)
    readings = Readings.of(pour)
    covariance = rho * (pour[:, None] == pour) + (1 - rho) * np.eye(80)
    root = readings.apart(np.eye(80), rho)
    np.testing.assert_allclose(root @ covariance @ root.T, np.eye(80), atol=1e-12)
    rows = np.random.default_rng(1).standard_normal((80, 3))
    np.testing.assert_allclose(readings.together(readings.apart(rows, rho), rho), rows, atol=1e-12)
    one = readings.apart(rows[:, 0], rho)
    np.testing.assert_allclose(one, readings.apart(rows, rho)[:, 0], atol=1e-12)


@pytest.mark.parametrize("rho", [0.0, 0.4, 0.9])
def test_what_is_shared_is_found(rho: float) -> None:
    generator = np.random.default_rng(2)
    pour = np.repeat(np.arange(4000), generator.integers(1, 5, 4000))
    own, each = generator.standard_normal(4000)[pour], generator.standard_normal(len(pour))
    noise = 0.3 * (np.sqrt(rho) * own + np.sqrt(1 - rho) * each)
    assert Readings.of(pour).shared(noise) == pytest.approx(rho, abs=0.03)
    assert Readings.of(np.arange(len(pour))).shared(noise) == 0.0


def test_copies_of_a_row_tell_nothing_more() -> None:
    generator = np.random.default_rng(3)
    x = generator.standard_normal((60, 4))
    y = x @ np.array([1.0, -2.0, 0.5, 0.0]) + 0.3 * generator.standard_normal(60)
    times = generator.integers(1, 9, 60)
    readings = Readings.of(np.repeat(np.arange(60), times))
    many, blocks = np.repeat(x, times, axis=0), [slice(0, 4)]
    apart = readings.apart(many, 0.99)
    target = readings.apart(np.repeat(y, times), 0.99)
    ones, each = np.ones(60), np.ones(len(many))
    alone = fit_blocks(x, y, ones, blocks, x.T @ x)
    found = fit_blocks(apart, target, each, blocks, apart.T @ apart)
    np.testing.assert_allclose(found.coefficients, alone.coefficients, atol=5e-3)
    # Taken for rows of their own, those that are copied most decide.
    plain = fit_blocks(many, np.repeat(y, times), each, blocks, many.T @ many)
    assert np.abs(plain.coefficients - alone.coefficients).max() > 1e-2


def archive(seed: int) -> Rows:
    """Base pours, half of them read under all effects; a tenth of noise is a reading's own."""
    generator = np.random.default_rng(seed)
    u, c = generator.random((2, BASE))
    noise = generator.standard_normal((BASE, SIZE))
    theta, condition, psi, x = [u], [c], [np.zeros((BASE, len(DESIGN.effects)))], []
    x.append((2 * u - 1)[:, None] * ALONG[0] + noise)
    for k in range(len(DESIGN.effects)):
        strength = np.zeros((SEEN, len(DESIGN.effects)))
        strength[:, k] = generator.random(SEEN)
        theta.append(u[:SEEN])
        condition.append(c[:SEEN])
        psi.append(strength)
        own = 0.1 * generator.standard_normal((SEEN, SIZE))
        x.append((2 * u[:SEEN] - 1)[:, None] * ALONG[0] + strength @ ALONG[1:] + noise[:SEEN] + own)
    where = np.concatenate(theta)[:, None], np.concatenate(condition)[:, None]
    return Rows(*where, np.concatenate(psi), np.concatenate(x))


def errors(is_told: bool) -> tuple[float, float, float, float]:
    """Squared error and claimed variance of the base mean, and of an effect's chord."""
    found = []
    generator = np.random.default_rng(9)
    u, c = generator.random((2, 40))
    none = np.zeros((40, len(DESIGN.effects)))
    half = none.copy()
    half[:, 1] = 0.5
    for seed in range(6):
        rows = archive(seed)
        one = Surrogate.fit(
            DESIGN,
            rows.theta,
            rows.condition,
            rows.psi,
            rows.x,
            pour=rows.pour if is_told else None,
            features=6,
        )
        plain = (2 * u - 1)[:, None] * ALONG[0]
        where = u[:, None], c[:, None]
        off = one.mean(*where, none) - one.standardise(plain)
        seen = one.mean(*where, half) - one.standardise(plain + half @ ALONG[1:])
        base, both = one.features(*where, none), one.features(*where, half)
        claimed = [np.mean(np.sum((base @ root) ** 2, axis=1)) for root in one.roots]
        chord = [np.mean(np.sum(((both - base) @ root) ** 2, axis=1)) for root in one.roots]
        known = np.mean(off**2), np.mean(claimed), np.mean((seen - off) ** 2), np.mean(chord)
        found.append(known)
    one, two, three, four = np.mean(found, axis=0).tolist()
    return one, two, three, four


def test_readings_are_no_pours_of_their_own() -> None:
    off, claimed, chord, of_chord = errors(is_told=True)
    assert 0.4 < off / claimed < 1.7
    plain, sure, blunt, _ = errors(is_told=False)
    # Taken for pours of their own they make a mean that is worse and claims to be better.
    assert plain > off and plain / sure > 2.5
    # An effect of the image is known from what it does to one and the same pour.
    assert chord < 0.5 * blunt and chord < 3 * of_chord


def test_pours_are_told_by_their_parameters() -> None:
    rows = archive(0)
    pour = rows.pour
    assert len(np.unique(pour)) == BASE
    assert (pour[BASE : BASE + SEEN] == pour[:SEEN]).all()
    bare = Rows(np.empty((3, 0)), np.zeros((3, 1)), np.zeros((3, 0)), np.zeros((3, 1)))
    assert bare.pour.tolist() == [0, 1, 2]
