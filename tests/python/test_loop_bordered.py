"""Roots of precisions that are block-diagonal but for a border."""

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop.surrogate.blocks import fit_blocks, fit_bordered
from granulcal.loop.surrogate.bordered import Features
from granulcal.loop.surrogate.bordering import Bordering
from granulcal.loop.surrogate.readings import Readings
from granulcal.loop.surrogate.roots import Change, Root, Roots

Array = NDArray[np.float64]

# Common features; three effects that are poured, of which the last two meet; one that none has.
BLOCKS = [slice(0, 5), slice(5, 8), slice(8, 12), slice(12, 14), slice(14, 16)]
READINGS = Readings.of(np.repeat(np.arange(60), 2))


def features() -> Array:
    """Pours of two rows each; the second effect is in the first row of its pours alone."""
    x = np.random.default_rng(0).standard_normal((120, 16))
    pour = READINGS.pour
    x[(pour < 10) | (pour >= 25), 5:8] = 0.0
    x[(pour < 25) | (pour >= 45), 8:12] = 0.0
    x[1::2, 8:12] = 0.0
    x[(pour < 40) | (pour >= 55), 12:14] = 0.0
    x[:, 14:] = 0.0
    return x


def kept(root: Root) -> Roots:
    """The roots of one statistic."""
    roots = Roots.room(root.bordering, 1)
    roots.keep(root, 0)
    return roots


@pytest.fixture(scope="module")
def bordering() -> Bordering:
    return Bordering.of(features(), BLOCKS, READINGS)


def test_what_never_meets_is_apart(bordering: Bordering) -> None:
    assert bordering.border.tolist() == [0, 1, 2, 3, 4]
    groups = [group.tolist() for group in bordering.groups]
    assert groups == [[5, 6, 7], [8, 9, 10, 11, 12, 13], [14, 15]]
    # All rows of their pours, which are mixed.
    rows = [np.unique(READINGS.pour[rows]).tolist() for rows in bordering.rows]
    assert rows == [list(range(10, 25)), list(range(25, 55)), []]
    assert [len(rows) for rows in bordering.rows] == [30, 60, 0]


def test_features_that_all_meet_have_no_groups() -> None:
    x = np.random.default_rng(1).standard_normal((120, 16))
    found = Bordering.of(x, BLOCKS, READINGS)
    assert found.groups == () and found.border.tolist() == list(range(16))


def test_products_are_those_of_all_features(bordering: Bordering) -> None:
    generator = np.random.default_rng(2)
    scale = np.exp(0.3 * generator.standard_normal(120))
    x = READINGS.apart(features(), 0.4, scale)
    found = Features.of(bordering, features()).apart(READINGS, 0.4, scale)
    c, y = generator.standard_normal(16), generator.standard_normal(120)
    np.testing.assert_allclose(found.times(c), x @ c, atol=1e-12)
    np.testing.assert_allclose(found.along(y), x.T @ y, atol=1e-12)
    precision = np.exp(generator.standard_normal(16))
    root = found.gram.root(0.3, precision)
    expected = np.linalg.inv(x.T @ x / 0.3 + np.diag(precision))
    whole = kept(root)[0]
    np.testing.assert_allclose(whole @ whole.T, expected, atol=1e-12)
    np.testing.assert_allclose(root.on(c), whole @ c, atol=1e-12)
    np.testing.assert_allclose(root.transposed_on(c), whole.T @ c, atol=1e-12)
    np.testing.assert_allclose(root.squares, np.diag(expected), atol=1e-12)
    np.testing.assert_allclose(found.squares(root), np.sum((x @ whole) ** 2, axis=1), atol=1e-12)


def test_the_fit_is_that_of_all_features(bordering: Bordering) -> None:
    generator = np.random.default_rng(3)
    x = READINGS.apart(features(), 0.2)
    y = x @ generator.standard_normal(16) + 0.3 * generator.standard_normal(120)
    plain = fit_blocks(x, y, np.ones(120), BLOCKS, x.T @ x)
    split = Features.of(bordering, features()).apart(READINGS, 0.2)
    found = fit_bordered(split, y, BLOCKS, split.gram)
    np.testing.assert_allclose(found.coefficients, plain.coefficients, atol=1e-10)
    np.testing.assert_allclose(found.left_out, plain.left_out, atol=1e-10)
    assert found.dof == pytest.approx(plain.dof, rel=1e-10)


def test_features_ask_for_rows_of_a_changed_root(bordering: Bordering) -> None:
    generator = np.random.default_rng(4)
    split = Features.of(bordering, features())
    plain = kept(split.gram.root(0.3, np.ones(16)))
    directions = np.linalg.qr(generator.standard_normal((16, 3)))[0]
    change = Change(directions, np.array([0.2, 0.5, 1.0]))
    roots = plain.after([change]).after([change])
    # The roots themselves are shared, not copied.
    assert roots.across is plain.across and len(roots) == 1
    taken = np.eye(16) - (directions * change.shares) @ directions.T
    expected = plain[0] @ taken @ taken
    np.testing.assert_allclose(roots[0], expected, atol=1e-12)
    asked = np.where(generator.random(16) < 0.4, generator.standard_normal((2, 16)), 0.0)
    np.testing.assert_allclose(roots.times(asked, 0), asked @ expected, atol=1e-12)
    vector = generator.standard_normal(16)
    np.testing.assert_allclose(roots.on(vector, 0), expected @ vector, atol=1e-12)
