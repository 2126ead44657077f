r"""Roots of the posterior covariances of all statistics' coefficients, kept small.

$B_j B_j^T$ is the posterior covariance of the coefficients of statistic j (`bordered.py`); what is
0 of $B_j$ is not kept. Pours that a surrogate learns later (`conditioned.py`) change a few
directions of it,

$$ B_j' = B_j (I - D_j \, \mathrm{diag}(\sigma_j) D_j^T), \qquad D_j^T D_j = I, $$

and these alone are kept beside the roots of the archive, which all surrogates of it share. Features
are 0 in most columns, and only the rows of $B_j$ that they ask for are made.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.bordering import Bordering

__all__ = ["Change", "Root", "Roots"]

Array = NDArray[np.float64]
Places = NDArray[np.intp]


@dataclass(frozen=True)
class Root:
    """B of one statistic: a row for each feature, columns in the order of `bordering`.

    Attributes:
        bordering: of the features.
        own: R of each group, upper triangular.
        across: -R R^T E^T T, the groups one after the other, shape (g, b).
        corner: T, upper triangular, shape (b, b).
    """

    bordering: Bordering
    own: tuple[Array, ...]
    across: Array
    corner: Array

    def on(self, vector: Array) -> Array:
        """Returns B times `vector` (d,)."""
        of, inner = self.bordering, vector[len(self.across) :]
        found = np.empty(len(vector))
        found[of.border] = self.corner @ inner
        for group, at, own in zip(of.groups, of.places, self.own, strict=True):
            found[group] = own @ vector[at] + self.across[at] @ inner
        return found

    def transposed_on(self, vector: Array) -> Array:
        """Returns B^T times `vector` (d,)."""
        of, found = self.bordering, np.empty(len(vector))
        inner = self.corner.T @ vector[of.border]
        for group, at, own in zip(of.groups, of.places, self.own, strict=True):
            found[at] = own.T @ vector[group]
            inner += self.across[at].T @ vector[group]
        found[len(self.across) :] = inner
        return found

    @property
    def squares(self) -> Array:
        """Sums of squares of the rows: the diagonal of B B^T, shape (d,)."""
        of, across = self.bordering, np.einsum("ij,ij->i", self.across, self.across)
        found = np.empty(len(of.order))
        found[of.border] = np.einsum("ij,ij->i", self.corner, self.corner)
        for group, at, own in zip(of.groups, of.places, self.own, strict=True):
            found[group] = np.sum(own**2, axis=1) + across[at]
        return found


@dataclass(frozen=True)
class Change:
    """What further pours take from a root.

    Attributes:
        directions: D, orthonormal columns, shape (d, r).
        shares: sigma, what is taken of each, shape (r,).
    """

    directions: Array
    shares: Array

    def of(self, rows: Array) -> Array:
        """Returns `rows` (..., d) of a root, or sums of them, as they are after it."""
        return rows - ((rows @ self.directions) * self.shares) @ self.directions.T


@dataclass(frozen=True)
class Roots:
    """The roots B of m statistics; those that are asked for are made whole, (d, d).

    Attributes:
        bordering: of the features.
        own: R of each group, shape (m, w, w) of w features.
        across: -R R^T E^T T, shape (m, g, b).
        corners: rows of T from the diagonal on, one after the other, shape (m, b (b + 1) / 2).
        changes: of all statistics, one set of pours after the other.
    """

    bordering: Bordering
    own: tuple[Array, ...]
    across: Array
    corners: Array
    changes: tuple[tuple[Change, ...], ...] = ()

    @classmethod
    def room(cls, bordering: Bordering, count: int) -> "Roots":
        """Returns room for the roots of `count` statistics.

        In one piece: between what a fit lets go of, small ones would keep that from being used.
        """
        size = len(bordering.border)
        return cls(
            bordering,
            tuple(np.empty((count, len(group), len(group))) for group in bordering.groups),
            np.empty((count, len(bordering.order) - size, size)),
            np.empty((count, size * (size + 1) // 2)),
        )

    def keep(self, root: Root, j: int) -> None:
        """Puts the root of statistic j where there is room for it."""
        for kept, own in zip(self.own, root.own, strict=True):
            kept[j] = own
        self.across[j] = root.across
        np.concatenate([row[i:] for i, row in enumerate(root.corner)], out=self.corners[j])

    @property
    def width(self) -> int:
        """Number of coefficients d."""
        return len(self.bordering.order)

    def __len__(self) -> int:
        """Number of statistics m."""
        return len(self.across)

    def __getitem__(self, j: int) -> Array:
        """B of statistic j, shape (d, d)."""
        return self._changed(self._rows(np.arange(self.width), j), j)

    def __iter__(self) -> Iterator[Array]:
        """B of one statistic after the other."""
        return (self[j] for j in range(len(self)))

    def times(self, features: Array, j: int) -> Array:
        """Returns `features` (n, d) times B of statistic j, shape (n, d)."""
        used = np.flatnonzero(features.any(axis=0))
        return self._changed(features[:, used] @ self._rows(used, j), j)

    def times_all(self, features: Array) -> Array:
        """Returns `features` (n, d) times B of each statistic, shape (n, m, d)."""
        found = np.empty((len(features), len(self), self.width))
        for j in range(len(self)):
            found[:, j] = self.times(features, j)
        return found

    def on(self, vector: Array, j: int) -> Array:
        """Returns B of statistic j times `vector` (d,), shape (d,)."""
        for change in reversed(self.changes):
            # It is symmetric.
            vector = change[j].of(vector)
        return self._rows(np.arange(self.width), j) @ vector

    def after(self, changes: Sequence[Change]) -> "Roots":
        """Returns the roots after one more change of each."""
        return replace(self, changes=(*self.changes, tuple(changes)))

    def _rows(self, which: Places, j: int) -> Array:
        """Some rows of B of statistic j before any change, shape (n, d)."""
        of = self.bordering
        inner, size = self.across.shape[1:]
        place = of.place[which]
        found = np.zeros((len(which), self.width))
        for row, at in zip(found, place.tolist(), strict=True):
            i = at - inner
            if i >= 0:
                start = i * size - i * (i - 1) // 2
                row[at:] = self.corners[j, start : start + size - i]
        for at, own in zip(of.places, self.own, strict=True):
            here = np.flatnonzero((place >= at.start) & (place < at.stop))
            found[here, at] = own[j, place[here] - at.start]
        grouped = place < inner
        found[grouped, inner:] = self.across[j, place[grouped]]
        return found

    def _changed(self, rows: Array, j: int) -> Array:
        for change in self.changes:
            rows = change[j].of(rows)
        return rows
