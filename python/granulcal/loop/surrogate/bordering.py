r"""Which features meet in no row, so that a precision matrix is block-diagonal but for a border.

A pour has one effect that is poured at most: in its rows the features of all others are 0. With the
features of the base model and of the image's effects last, as a border, the precision of the
coefficients is

$$ A = \begin{pmatrix} D & E^T \\ E & F \end{pmatrix}, \qquad D = \mathrm{diag}(D_1, D_2, \dots) $$

with a group k for what meets no other group.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.readings import Readings

__all__ = ["Bordering"]

Array = NDArray[np.float64]
Places = NDArray[np.intp]


@dataclass(frozen=True)
class Bordering:
    """Which features meet.

    Attributes:
        groups: columns of each group.
        rows: where a group's features may be other than 0; no row is of two groups.
        border: all other columns.
    """

    groups: tuple[Places, ...]
    rows: tuple[Places, ...]
    border: Places

    @classmethod
    def none(cls, width: int) -> "Bordering":
        """Returns that of features that all meet."""
        return cls((), (), np.arange(width))

    @classmethod
    def of(cls, x: Array, blocks: Sequence[slice], readings: Readings) -> "Bordering":
        """Returns the one that takes the least work.

        The border is what meets most. Rows of one pour are mixed (`readings.py`), so that what one
        of them has meets what another has.

        Args:
            x: features, shape (n, d).
            blocks: columns that stay together.
            readings: which of the rows are of one pour.
        """
        seen = np.zeros((len(readings.counts), len(blocks)))
        for i, block in enumerate(blocks):
            seen[readings.pour[x[:, block].any(axis=1)], i] = 1.0
        meets: Array = np.minimum(seen.T @ seen, 1.0)
        widths = np.array([block.stop - block.start for block in blocks])
        order = np.argsort(-(meets @ widths), kind="stable")
        tried = [_split(meets, order[:count]) for count in range(len(blocks), 0, -1)]
        groups, border = min(tried, key=lambda split: _work(widths, *split))
        columns = [np.arange(block.start, block.stop) for block in blocks]
        pours = (np.flatnonzero(seen[:, group].any(axis=1)) for group in groups)
        return cls(
            tuple(np.concatenate([columns[i] for i in group]) for group in groups),
            tuple(np.flatnonzero(np.isin(readings.pour, which)) for which in pours),
            np.concatenate([columns[i] for i in border]),
        )

    @property
    def places(self) -> tuple[slice, ...]:
        """Where each group stands among the columns of all groups, one after the other."""
        stops = np.cumsum([0, *(len(group) for group in self.groups)]).tolist()
        return tuple(slice(a, b) for a, b in pairwise(stops))

    @cached_property
    def order(self) -> Places:
        """All columns, those of the groups first, shape (d,)."""
        return np.concatenate([*self.groups, self.border])

    @cached_property
    def place(self) -> Places:
        """Where each column stands in `order`, shape (d,)."""
        return np.argsort(self.order)


def _split(meets: Array, border: Places) -> tuple[list[Places], Places]:
    """What falls apart without a border: numbers of blocks that meet, directly or not."""
    from scipy.sparse.csgraph import connected_components

    left = np.setdiff1d(np.arange(len(meets)), border)
    count, group = connected_components(meets[np.ix_(left, left)], directed=False)
    return [left[group == k] for k in range(count)], np.sort(border)


def _work(widths: Places, groups: Sequence[Places], border: Places) -> float:
    """Multiplications that a root takes, about, of blocks of such widths."""
    b, each = float(widths[border].sum()), np.array([float(widths[g].sum()) for g in groups])
    return b**3 / 3 + b**2 * each.sum() + float(np.sum(2 * b * each**2 + each**3 / 3))
