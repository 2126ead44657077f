r"""The surrogate at the conditions of one experiment, and the covariance of its mean pours there.

$$ V(\theta, \psi) = \mathrm{diag}_h \frac{s R_h s}{n_h} \frac{\nu}{\nu - m - 1}
   + U(\psi) + \lambda s^2 + A + \sum_{k\ \mathrm{nuisance}} \gamma_k^2 N_k N_k^T $$

$R_h$ is the correlation of archive rows near the point; U is the posterior covariance of the
surrogate's mean, shared by all pours of a condition and correlated between conditions; it is a
function of $\psi$ whose coefficients are taken at one theta. A is the noise of an anchor
(`anchor.py`), $N_k$ the direction of a declared nuisance. Vectors stack the conditions: entry
h m + i is axis i under condition h.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.surrogate.mean_error import MeanError
from granulcal.loop.surrogate.surrogate import Surrogate

__all__ = ["LinearisedSurrogate"]

Array = NDArray[np.float64]

# Width of "near" in unit coordinates of parameters and conditions.
NEAR = 0.35
_STEP = 1e-3
FAINT, PLAIN = 0.25, 0.5
"""Shares of its prior's upper end to which the directions of an effect lead: about what is hardly
seen, and what is. Effects that bend (drag, blur, rods) go elsewhere at one than at the other."""


@dataclass(frozen=True)
class LinearisedSurrogate:
    """What does not change while theta moves a little.

    Attributes:
        surrogate: the emulator.
        conditions: shape (H, q).
        counts: pours of each condition, shape (H,).
        v: prior z-scores of the point around which this holds, shape (p,).
        correlations: R_h times the Hotelling factor, shape (H, m, m).
        mean_error: of the surrogate's mean, but for the shifts.
        own_errors: what a standard deviation of each declared nuisance does, shape (N, H, m).
        sessions: number of the session of each condition, shape (H,).
        is_known: whether the surrogate's mean counts as known: U is 0.
    """

    surrogate: Surrogate
    conditions: Array
    counts: Array
    v: Array
    correlations: Array
    mean_error: MeanError
    own_errors: Array
    sessions: NDArray[np.int64]
    is_known: bool = False

    @classmethod
    def at(
        cls,
        surrogate: Surrogate,
        conditions: Array,
        counts: Array,
        v: Array,
        sessions: NDArray[np.int64] | None = None,
    ) -> "LinearisedSurrogate":
        """Returns what holds around `v` (p,); None: a session for each condition."""
        theta = cube_from_normal(v)
        count, size = len(conditions), surrogate.size
        rows = np.tile(theta, (count, 1))
        dof = surrogate.dof * np.mean(~surrogate.is_donor)
        factor = dof / max(dof - size - 1, 1.0)
        correlations = np.stack(
            [factor * surrogate.correlation_near(theta, c, NEAR) for c in conditions]
        )
        nuisances = surrogate.design.nuisances
        own_errors = np.empty((len(nuisances), count, size))
        for i, k in enumerate(nuisances):
            effect = surrogate.design.effects[k]
            linear = surrogate.effect_features(rows, conditions, k)[0]
            along = linear @ surrogate.coefficients.T + surrogate.effect_move(rows, conditions, k)
            own_errors[i] = (effect.nuisance_sd or 0.0) * along
            at = np.full(count, effect.nuisance_sd or 0.0)
            sines = surrogate.curve_features(at, np.column_stack([rows, conditions]), k)
            own_errors[i] += sines @ surrogate.coefficients[:, surrogate.curve(k)].T
        return cls(
            surrogate,
            conditions,
            counts,
            v,
            correlations,
            MeanError(surrogate, rows, conditions),
            own_errors,
            np.arange(count) if sessions is None else sessions,
        )

    @cached_property
    def nuisance(self) -> Array:
        """Covariance of the declared nuisances, shape (H m, H m)."""
        design = self.surrogate.design
        each = np.repeat(self.sessions, self.surrogate.size)
        total = np.zeros((self.size, self.size))
        for k, along in zip(design.nuisances, self.own_errors, strict=True):
            same = True if design.effects[k].is_shared else each[:, None] == each
            total += same * np.outer(along, along)
        return total

    @property
    def size(self) -> int:
        """H m."""
        return len(self.conditions) * self.surrogate.size

    def in_statistics(self, columns: Array) -> Array:
        """Returns stacked `columns` (H m, any) on axes as those of standardised statistics."""
        count, size = len(self.conditions), self.surrogate.size
        cube = columns.reshape(count, size, -1)
        return np.matmul(self.surrogate.from_axes, cube).reshape(columns.shape)

    def none(self) -> Array:
        """Returns strengths of 0, shape (K,)."""
        return self.surrogate.design.none()

    def mean(self, v: Array, psi: Array) -> Array:
        """Returns the stacked mean, shape (H m,)."""
        return self._means(v[None], psi[None])[0]

    def slopes(self, v: Array, psi: Array, active: tuple[int, ...]) -> tuple[Array, Array]:
        """Returns the stacked mean and its derivatives in v and psi[active], (H m, p + |A|)."""
        p, a = len(v), len(active)
        moved_v = np.tile(v, (1 + 2 * (p + a), 1))
        moved_psi = np.tile(psi, (1 + 2 * (p + a), 1))
        for i in range(p):
            moved_v[1 + 2 * i, i] += _STEP
            moved_v[2 + 2 * i, i] -= _STEP
        for i, k in enumerate(active):
            moved_psi[1 + 2 * (p + i), k] += _STEP
            moved_psi[2 + 2 * (p + i), k] -= _STEP
        means = self._means(moved_v, moved_psi)
        return means[0], ((means[1::2] - means[2::2]) / (2 * _STEP)).T

    def direction(self, v: Array, k: int, psi: Array | None = None, to: float = FAINT) -> Array:
        """Returns what effect k does for a unit of strength, shape (H m,).

        From none of it to the strength `to`; two-sided: the derivative. `psi` are the strengths of
        the other effects.
        """
        at = self.none() if psi is None else psi
        low, high = at.copy(), at.copy()
        low[k], high[k] = self._span(k, to)
        means = self._means(np.tile(v, (2, 1)), np.stack([low, high]))
        return (means[1] - means[0]) / (high[k] - low[k])

    def directions(self, v: Array, k: int, psi: Array | None = None) -> tuple[Array, Array]:
        """Returns the directions of effect k to `FAINT` and to `PLAIN`; two-sided: one for both."""
        faint = self.direction(v, k, psi)
        if self.surrogate.design.effects[k].is_two_sided:
            return faint, faint
        return faint, self.direction(v, k, psi, PLAIN)

    def _span(self, k: int, to: float = FAINT) -> tuple[float, float]:
        """Strengths between which an effect has its direction."""
        return (-FAINT, FAINT) if self.surrogate.design.effects[k].is_two_sided else (0.0, to)

    def covariance(self, v: Array, psi: Array) -> Array:
        """Returns V, shape (H m, H m)."""
        return self.pour_covariance(v, psi) + self.error_covariance(v, psi) + self.nuisance

    def pour_covariance(self, v: Array, psi: Array) -> Array:
        """Returns the covariance of the means of pours, shape (H m, H m)."""
        scale = self.scales(v, psi) / np.sqrt(self.counts)[:, None]
        size = self.surrogate.size
        total = np.zeros((self.size, self.size))
        for h, correlation in enumerate(self.correlations):
            part = slice(h * size, (h + 1) * size)
            total[part, part] = correlation * np.outer(scale[h], scale[h])
        return total

    def scales(self, v: Array, psi: Array) -> Array:
        """Returns the scale of a pour's noise on each axis under each condition, shape (H, m)."""
        count = len(self.conditions)
        theta = np.tile(cube_from_normal(v), (count, 1))
        return self.surrogate.scale(theta, self.conditions, np.tile(psi, (count, 1)))

    def error_covariance(self, v: Array, psi: Array) -> Array:
        """Returns U, what the features cannot follow and an anchor's noise, (H m, H m)."""
        total = self._mean_covariance(psi)
        lack = self.surrogate.lack * self.scales(v, psi) ** 2
        total[np.diag_indices_from(total)] += lack.ravel()
        if self.surrogate.anchor is not None:
            theta = cube_from_normal(v)
            of_anchor = self.surrogate.anchor.covariance(theta, self.conditions, psi)
            total += of_anchor.reshape(total.shape)
        return total

    def direction_error(self, k: int) -> Array:
        """Returns the covariance of `direction(k)`, shape (H m, H m)."""
        return self._direction_errors[k]

    def error_root(self, psi: Array) -> Array:
        """Returns the root of the mean's uncertainty, but for the shifts, shape (H, m, d)."""
        return self.mean_error.root(psi)

    @cached_property
    def shift_roots(self) -> Array:
        """Roots of the uncertainty of the shifts that effects are in part, shape (K, H m, r)."""
        u = np.column_stack([self.mean_error.theta, self.conditions])
        effects = range(len(self.surrogate.design.effects))
        each = [self.surrogate.shift.root(u, k) for k in effects]
        return np.array([root.reshape(self.size, root.shape[-1]) for root in each])

    @cached_property
    def _direction_errors(self) -> list[Array]:
        effects = range(len(self.surrogate.design.effects))
        if self.is_known:
            return [np.zeros((self.size, self.size)) for _ in effects]
        found = []
        for k in effects:
            shift = self.shift_roots[k]
            found.append(self._error(self.mean_error.chord(k, *self._span(k))) + shift @ shift.T)
        return found

    def _mean_covariance(self, psi: Array) -> Array:
        """U at strengths (K,), shape (H m, H m)."""
        if self.is_known:
            return np.zeros((self.size, self.size))
        if not psi.any():
            return self._base_error.copy()
        active = np.nonzero(psi)[0]
        shift = np.sum([psi[k] * self.shift_roots[k] for k in active], axis=0)
        return self._error(self.error_root(psi)) + shift @ shift.T

    @cached_property
    def _base_error(self) -> Array:
        return self._error(self.error_root(self.none()))

    def _error(self, roots: Array) -> Array:
        """Errors on different axes are independent."""
        count, size = len(self.conditions), self.surrogate.size
        each = np.matmul(roots.transpose(1, 0, 2), roots.transpose(1, 2, 0))
        total = np.zeros((count, size, count, size))
        axis = np.arange(size)
        total[:, axis, :, axis] = each
        return total.reshape(count * size, count * size)

    def _means(self, v: Array, psi: Array) -> Array:
        count, conditions = len(self.conditions), self.conditions
        theta = np.repeat(cube_from_normal(v), count, axis=0)
        rows = np.tile(conditions, (len(v), 1))
        strengths = np.repeat(psi, count, axis=0)
        return self.surrogate.mean(theta, rows, strengths).reshape(len(v), -1)
