"""Several pours of one material among the training pairs."""

import numpy as np
import pytest

from granulcal.bayessim import BayesSim
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.replicates import dealt, firsts, gathered, in_turns, material_of, split
from granulcal.errors import TrainingDataError


def _pours(materials=9, each=4, seed=0):
    generator = np.random.default_rng(seed)
    theta = np.repeat(generator.random((materials, 3)), each, axis=0)
    return material_of(theta), generator.permutation(len(theta))


def test_rows_of_one_material_are_known():
    theta = np.array([[1.0, 2.0], [0.0, 5.0], [1.0, 2.0], [1.0, 3.0], [0.0, 5.0]])
    first, other, again, third, last = material_of(theta)
    assert first == again and other == last and len({first, other, third}) == 3
    assert material_of(theta[:0]).tolist() == []


def test_no_material_is_on_two_sides():
    material, order = _pours()
    for count in range(len(order) + 1):
        test, rest = split(order, material, count)
        assert count <= len(test) <= count + 3
        assert not set(material[test]) & set(material[rest])
        assert sorted([*test, *rest]) == list(range(len(order)))
    hands = dealt(order, material, 4)
    assert sorted(np.concatenate(hands)) == list(range(len(order)))
    of_hands = [set(material[hand]) for hand in hands]
    assert sum(map(len, of_hands)) == 9
    assert [len(found) for found in of_hands] == [3, 2, 2, 2]


def test_materials_take_turns():
    material, order = _pours()
    turns = material[in_turns(order, material)].reshape(4, 9)
    assert (turns == turns[0]).all() and len(set(turns[0])) == 9
    assert (np.diff(np.flatnonzero(np.diff(material[gathered(order, material)]))) == 4).all()


def test_pours_of_a_material_each_are_split_as_ever():
    material, order = _pours(materials=30, each=1)
    assert (gathered(order, material) == order).all()
    assert (in_turns(order, material) == order).all()
    test, rest = split(order, material, 7)
    assert (test == order[:7]).all() and (rest == order[7:]).all()
    for start, hand in enumerate(dealt(order, material, 4)):
        assert (hand == order[start::4]).all()


def test_few_materials_are_dealt_by_their_pours():
    material, order = _pours(materials=2)
    assert [len(hand) for hand in dealt(order, material, 4)] == [2, 2, 2, 2]


def test_a_material_counts_once_in_a_check():
    """Checks that count ten pours of a material each fail exact posteriors four times in five."""
    assert firsts(np.array([2, 0, 2, 1, 0])).tolist() == [0, 1, 3]
    toy = LinearGaussian.random(seed=3, noise=3.0, bounded=True)
    theta = np.repeat(toy.prior.sample(30, seed=1), 10, axis=0)
    x = toy.simulate_at(theta, seed=2)
    model = BayesSim.fit(theta, x, toy.prior, quiet=True, method="emulated")
    assert model.calibration is not None and model.calibration.test_count == 30
    assert model.summary.test_count == 30
    fresh = np.repeat(toy.prior.sample(20, seed=3), 5, axis=0)
    seen = toy.simulate_at(fresh, seed=4)
    all_of_them, first = model.check(fresh, seen), model.check(fresh[::5], seen[::5])
    assert all_of_them.as_dict() == first.as_dict()
    with pytest.raises(TrainingDataError, match="10 usable pairs of different parameters .* got 9"):
        model.check(fresh[:45], seen[:45])
