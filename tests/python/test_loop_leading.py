"""The leading eigenfunctions of a kernel as features: errors are as large as claimed."""

import numpy as np
import pytest

from granulcal.loop.effects.design import Design
from granulcal.loop.surrogate.leading import LeadingBasis
from granulcal.loop.surrogate.surrogate import Surrogate


def test_few_eigenfunctions_have_nearly_all_of_the_kernel() -> None:
    generator = np.random.default_rng(0)
    rows = generator.random((200, 3))
    found = LeadingBasis.draw(rows, np.array([1.5, 2.0, 3.0]), most=192, seed=1)
    points = generator.random((500, 3))
    waves = found.basis(points)[:, -len(found.turn) :]
    kept = found(points)[:, -found.size :]
    assert found.size < 100
    # A point of the kernel has variance 1.
    missed = np.sum(waves**2, axis=1) - np.sum(kept**2, axis=1)
    assert np.sum(waves**2, axis=1) == pytest.approx(1)
    assert missed.min() > -1e-9
    assert missed.mean() == pytest.approx(1e-3, rel=0.5)
    # They are eigenfunctions: uncorrelated over the cube, the largest first.
    gram = kept.T @ kept / len(points)
    assert np.abs(gram[:5, :5] - np.diag(np.diag(gram)[:5])).max() < 0.1 * gram[0, 0]
    assert (np.diff(np.diag(gram)[:5]) < 0).all()


def test_no_more_eigenfunctions_than_asked_for() -> None:
    rows = np.random.default_rng(0).random((50, 2))
    found = LeadingBasis.draw(rows, np.ones(2), most=7, seed=0)
    # 1, two slopes, three products; then the seven.
    assert (found.size, found(rows).shape) == (7, (50, 13))


def test_the_error_of_a_rough_mean_is_as_large_as_claimed() -> None:
    # As many random features as there are eigenfunctions claimed two thirds of it.
    random = np.random.default_rng(7)
    inner, shift = 0.8 * random.standard_normal((4, 20)), random.standard_normal(20)
    outer = random.standard_normal((20, 8)) / np.sqrt(20)

    def mean(u: np.ndarray) -> np.ndarray:
        return np.tanh((2 * u - 1) @ inner + shift) @ outer

    ratios = []
    for _ in range(3):
        u, places = random.random((300, 4)), random.random((500, 4))
        x = mean(u) + 0.15 * random.standard_normal((300, 8))
        design = Design(("a", "b", "c"), ("height",), ())
        found = Surrogate.fit(design, u[:, :3], u[:, 3:], np.zeros((300, 0)), x)
        at = places[:, :3], places[:, 3:], np.zeros((500, 0))
        features = found.features(*at)
        claimed = np.stack([np.sum((features @ root) ** 2, axis=1) for root in found.roots], axis=1)
        claimed += found.lack * found.scale(*at) ** 2
        error = found.standardise(mean(places)) - found.mean(*at)
        ratios.append(float(np.mean(error**2) / np.mean(claimed)))
    assert np.mean(ratios) == pytest.approx(1, abs=0.2)
