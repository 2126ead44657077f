r"""What an effect does that parameters could have done: a shift of theta that all statistics share.

$$ g_k(u, c) = J(u, c) a_k(u, c) + \tilde g_k(u, c), \qquad J = \partial f_0 / \partial \theta $$

with $a_k$ linear in the coordinates. Most effects act along what the parameters do, nearly exactly;
learnt for each statistic by itself that part of $g_k$ has the error of a few pours in every
direction, and an effect whose own trace is small beside that error is taken for weak. $a_k$ has
p (1 + p + q) numbers that all statistics of all pours of the effect decide together, and what is
left for $\tilde g_k$ is small, and known to be (`blocks.py`). Widths of the prior of each $a_k$ and
the noise are at a maximum of the evidence, as there.

Reference:
    MacKay, Bayesian interpolation, Neural Computation 4, 1992, section 5.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.leading import LeadingBasis
from granulcal.loop.surrogate.triangle import root_of

__all__ = ["Shift"]

Array = NDArray[np.float64]

_ROUNDS = 12
_SMALLEST, _LARGEST = 1e-8, 1e2
_STEP = 1e-3
# Rows whose products are summed at a time.
_CHUNK = 400


@dataclass(frozen=True)
class Shift:
    """The shifts of all effects.

    Attributes:
        basis: of f_0.
        coefficients: of f_0, without any effect, shape (m, d).
        parameters: p, the first columns of u.
        shifts: of a_k over 1 and the coordinates, shape (K, p, 1 + p + q).
        roots: of the posterior covariance of each effect's numbers, shape (K, p (1 + p + q), r).
    """

    basis: LeadingBasis
    coefficients: Array
    parameters: int
    shifts: Array
    roots: Array

    @classmethod
    def fit(
        cls,
        basis: LeadingBasis,
        coefficients: Array,
        sizes: Array,
        u: Array,
        psi: Array,
        z: Array,
        parameters: int,
    ) -> "Shift":
        """Returns the shifts of effects.

        Args:
            basis: of f_0.
            coefficients: of f_0, learnt from pours without effects, shape (m, d).
            sizes: standard deviation of a pour on each axis, shape (m,).
            u: coordinates of pours with effects, theta first, shape (n, p + q).
            psi: their strengths, shape (n, K).
            z: what they showed, on the axes, shape (n, m).
            parameters: p.
        """
        count, terms = psi.shape[1], u.shape[1] + 1
        p = parameters
        blank = cls(basis, coefficients, p, np.zeros((count, p, terms)), np.zeros((count, 0, 0)))
        width = p * terms
        gram, along = np.zeros((count * width, count * width)), np.zeros(count * width)
        square = 0.0
        for start in range(0, len(u), _CHUNK):
            rows = slice(start, start + _CHUNK)
            moves = blank._moves(u[rows]) / sizes[:, None]
            left = ((z[rows] - basis(u[rows]) @ coefficients.T) / sizes).ravel()
            active = np.nonzero(psi[rows].any(axis=0))[0]
            x = np.concatenate(
                [(psi[rows, k, None, None] * moves).reshape(len(left), -1) for k in active], axis=1
            )
            at = np.concatenate([np.arange(k * width, (k + 1) * width) for k in active])
            gram[np.ix_(at, at)] += x.T @ x
            along[at] += x.T @ left
            square += float(left @ left)
        c, root = _ridge(gram, along, square, len(u) * z.shape[1], count)
        return cls(
            basis,
            coefficients,
            p,
            c.reshape(count, p, terms),
            np.stack([root[k * width : (k + 1) * width] for k in range(count)])
            if count
            else np.zeros((0, width, 0)),
        )

    def move(self, u: Array, k: int) -> Array:
        """Returns J a_k at rows of (theta, c), shape (n, m)."""
        psi = np.zeros((len(u), len(self.shifts)))
        psi[:, k] = 1.0
        return self.along(u, psi)

    def along(self, u: Array, psi: Array) -> Array:
        r"""Returns $J \sum_k \psi_k a_k$ at rows of (theta, c), a slope of f_0, shape (n, m)."""
        numbers = (psi @ self.shifts.reshape(len(self.shifts), -1)).reshape(
            len(u), self.parameters, -1
        )
        by = (numbers @ _terms(u)[:, :, None])[:, :, 0]
        up, down = u.copy(), u.copy()
        up[:, : self.parameters] += _STEP * by
        down[:, : self.parameters] -= _STEP * by
        change = (self.basis(up) - self.basis(down)) / (2 * _STEP)
        return change @ self.coefficients.T

    def root(self, u: Array, k: int) -> Array:
        """Returns the root of the covariance of `move`, shape (n, m, r)."""
        return self._moves(u) @ self.roots[k]

    def _moves(self, u: Array) -> Array:
        """What each number of a_k does, shape (n, m, p (1 + p + q))."""
        slopes = np.empty((len(u), len(self.coefficients), self.parameters))
        for i in range(self.parameters):
            up, down = u.copy(), u.copy()
            up[:, i] += _STEP
            down[:, i] -= _STEP
            change = (self.basis(up) - self.basis(down)) / (2 * _STEP)
            slopes[:, :, i] = change @ self.coefficients.T
        return (slopes[:, :, :, None] * _terms(u)[:, None, None, :]).reshape(*slopes.shape[:2], -1)


def _terms(u: Array) -> Array:
    """What a_k is linear in, shape (n, 1 + p + q)."""
    return np.concatenate([np.ones((len(u), 1)), 2 * u - 1], axis=1)


def _ridge(
    gram: Array, along: Array, square: float, count: int, blocks: int
) -> tuple[Array, Array]:
    """Coefficients and the root of their covariance; a prior width for each of equal blocks."""
    size = len(along) // max(blocks, 1)
    widths, variance = np.full(blocks, 0.1), 1.0
    root, c = np.eye(len(along)), np.zeros(len(along))
    for _ in range(_ROUNDS if blocks else 0):
        precision = gram / variance
        precision[np.diag_indices_from(precision)] += 1 / np.repeat(widths, size)
        root = root_of(precision)
        c = root @ (root.T @ (along / variance))
        spread, known = np.sum(root**2, axis=1), 0.0
        for b in range(blocks):
            part = slice(b * size, (b + 1) * size)
            own = max(size - float(spread[part].sum()) / widths[b], 1e-6)
            widths[b] = min(max(float(c[part] @ c[part]) / own, _SMALLEST), _LARGEST)
            known += own
        left = max(square - 2 * float(c @ along) + float(c @ gram @ c), 1e-300)
        variance = left / max(count - known, 1.0)
    return c, root
