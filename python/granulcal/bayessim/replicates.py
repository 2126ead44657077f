"""Several pours of one material among the pairs: wherever those are split, they stay on one side.

Pours of one material differ by chance alone. A network that has seen some of them knows the
parameters of the others, and a check on those would find it right however wrong it is elsewhere.
Nor are they as many truths: ranks and regions of one truth hang together, and a check that counts
each finds right posteriors wrong.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["dealt", "firsts", "gathered", "in_turns", "material_of", "split"]

Array = NDArray[np.float64]
Rows = NDArray[np.intp]


def material_of(theta: Array) -> Rows:
    """Returns a number for each row, equal for equal parameters, shape (n,)."""
    order = np.lexsort(theta.T[::-1])
    is_new = (theta[order[1:]] != theta[order[:-1]]).any(axis=1)
    number = np.empty(len(theta), dtype=np.intp)
    number[order] = np.concatenate([[0], np.cumsum(is_new)])[: len(theta)]
    return number


def firsts(material: Rows) -> Rows:
    """Returns the rows that are the first of their material, in their order."""
    return np.sort(np.unique(material, return_index=True)[1])


def gathered(order: Rows, material: Rows) -> Rows:
    """Returns the rows with those of one material together, as each is first in `order`."""
    return order[np.argsort(_rank(order, material), kind="stable")]


def split(order: Rows, material: Rows, count: int) -> tuple[Rows, Rows]:
    """Returns `count` rows at least, or all of the materials that they are of, and the others."""
    rows = gathered(order, material)
    if 0 < count < len(rows):
        same = np.flatnonzero(material[rows] == material[rows[count - 1]])
        count = int(same[-1]) + 1
    return rows[:count], rows[count:]


def dealt(order: Rows, material: Rows, parts: int) -> list[Rows]:
    """Returns the rows of `parts` hands, to which the materials are dealt one by one.

    Fewer materials than hands cannot be kept apart: their pours are dealt.
    """
    rank = _rank(order, material)
    hand = (rank if rank.max(initial=0) >= parts - 1 else np.arange(len(order))) % parts
    return [order[hand == number] for number in range(parts)]


def in_turns(order: Rows, material: Rows) -> Rows:
    """Returns the rows with the first of each material before the second of any."""
    rows = gathered(order, material)
    rank = _rank(rows, material)
    # Of gathered rows: how many of its material stand before each.
    before = np.arange(len(rows)) - np.searchsorted(rank, rank)
    return rows[np.argsort(before, kind="stable")]


def _rank(order: Rows, material: Rows) -> Rows:
    """How many materials come before that of each row of `order`, shape of `order`."""
    found = material[order]
    first = np.full(len(material) + 1, len(order), dtype=np.intp)
    np.minimum.at(first, found, np.arange(len(order)))
    return np.searchsorted(np.unique(first[found]), first[found])
