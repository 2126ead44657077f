r"""One set of numbers for the beads of all columns, and how it tells tests of other days.

The fronts $f_i(u, t)$ of a measured test i are emulated by a quadratic polynomial in the six
coordinates u of `UNKNOWN`, from one pour each at points of a Sobol sequence. What the beads are
(friction between them, restitution) is the same in every test; the ground and the tube are those of
the bench (1 g) or of the centrifuge. With a clock $c$ for each day of each apparatus,

$$ \min_{u, c} \sum_{i, t} \frac{(f_i(u, t - c_i) - r_i(t))^2}{(s^2 + e_i(t)^2)\, \max(1, T_i / 4)}
   + \sum_k \frac{(u_k - 1/2)^2}{1 / 12} + \sum_{day} \frac{c^2}{s_c^2}, \qquad 0 \le u \le 1 $$

with the error e of the emulator (leave one out), s = 5 mm and s_c = 20 ms. The $T_i$ times of one
front count as four, and the uniform priors as normals of their mean and spread: what the fronts do
not tell stays in the middle. Until the beads have come out from under the tube all that is seen is
the tube, and such times are not fitted.

A test is told by the fit without its day, at the mean clock of the apparatus' other days. The error
of a row is the root mean square of what such rows are off by, at equal times of free fall and of
one apparatus, and what the scatter of the clocks does where gravity is stronger than in the tests
that tell the error.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.stats import qmc

from granulcal.bayessim.emulator.basis import polynomial
from granulcal.bayessim.emulator.ridge import Ridge
from granulcal.experiments.predictions.between_tests import Told
from granulcal.experiments.predictions.column_pours import UNKNOWN, ColumnPours
from granulcal.experiments.predictions.column_tests import Fronts, Test, times_of

__all__ = [
    "APPARATUS",
    "POINTS",
    "ColumnFit",
    "Emulated",
    "apparatus",
    "with_own_clock",
]

Array = NDArray[np.float64]

APPARATUS = ("bench", "centrifuge")
"""Where tests are made: at one g or above."""
POINTS = 64
"""Pours of each measured test."""
_DESIGN_SEED = 5
# One sd of the model's own error [mm] and of a day's clock [s]; times of a front that count.
_OWN, _CLOCK, _COUNT = 5.0, 0.02, 4.0
# Radius of the column [mm].
_COLUMN = 54.0
# What is seen until the beads come out from under the tube [mm].
_TUBE = 62.0
_STARTS = 8
# Of the unknowns so many are of the beads, the others of the apparatus.
_OF_BEADS = 3
_COORDINATES = 2 * len(UNKNOWN.names) - _OF_BEADS


@dataclass(frozen=True)
class Emulated:
    """Fronts of one test over the unit cube of `UNKNOWN`.

    Attributes:
        times: of the fronts [s], shape (T,).
        coefficients: of the monomials, those of the end last [mm], shape (d, T + 1).
        error: of a pour less the emulator of the others, root mean square [mm], shape (T + 1,).
    """

    times: Array
    coefficients: Array
    error: Array

    @classmethod
    def of(cls, test: Test, points: Array, fronts: Array) -> "Emulated":
        """Returns the emulator of pours at `points` (n, 6) with `fronts` (n, T + 1)."""
        ridge = Ridge(polynomial(2 * points - 1, 2))
        coefficients, error = [], []
        for column in fronts.T:
            seen = np.isfinite(column)
            part = ridge if seen.all() else Ridge(polynomial(2 * points[seen] - 1, 2))
            middle = column[seen].mean()
            fit = part.fit(column[seen] - middle)
            coefficients.append(fit.coefficients + np.eye(len(fit.coefficients))[0] * middle)
            error.append(np.sqrt(np.mean(fit.loo_residuals(column[seen] - middle) ** 2)))
        return cls(times_of(test), np.array(coefficients).T, np.array(error))

    def at(self, u: Array) -> Array:
        """Returns the front at u (6,) [mm], shape (T + 1,)."""
        return np.asarray((polynomial(2 * u[None] - 1, 2) @ self.coefficients)[0])


@dataclass(frozen=True)
class _Fit:
    """Coordinates of both apparatuses, shape (2, 6), and clocks [s] by day and apparatus."""

    u: Array
    clocks: dict[tuple[str, int], float]

    def clock(self, apparatus: int) -> float:
        """The mean of all days of an apparatus, 0 where none is known [s]."""
        known = [clock for (_, its), clock in self.clocks.items() if its == apparatus]
        return sum(known) / max(1, len(known))


class ColumnFit:
    """The fit to all days, and those without each of them.

    Args:
        fronts: measured tests.
        columns: their pours.
        name: of the model, for the progress.
    """

    def __init__(self, fronts: Fronts, columns: ColumnPours, name: str) -> None:
        """Pours what is missing and fits."""
        self.fronts, self._columns = fronts, columns
        # Tests of one scene are poured once.
        scenes = [columns.scene(test) for test in fronts.tests]
        first = [scenes.index(scene) for scene in scenes]
        emulated = self._emulate([fronts.tests[i] for i in sorted(set(first))], name)
        self.emulated: tuple[Emulated, ...] = tuple(emulated[fronts.tests[i].code] for i in first)
        self._days = np.array([test.campaign for test in fronts.tests])
        self._apparatus = np.array([apparatus(test) for test in fronts.tests])
        self._all = self._fit(np.full(len(self._days), True))
        self._without = {day: self._fit(self._days != day) for day in sorted(set(self._days))}
        told = [self._told(i, self._without[day]) for i, day in enumerate(self._days)]
        self.gaps: Array = fronts.radius - np.array(told)

    def unknown(self, of: int) -> dict[str, float]:
        """Returns the values of `UNKNOWN` of an apparatus, by the fit to all days."""
        return dict(zip(UNKNOWN.names, self._values(of).tolist(), strict=True))

    def clocks(self, of: int) -> dict[str, float]:
        """Returns what each day's clock is late by [s]."""
        return {day: clock for (day, its), clock in self._all.clocks.items() if its == of}

    def fitted(self) -> Array:
        """Returns what the fit to all days leaves of the measured fronts [mm], shape (n, T + 1)."""
        each = enumerate(zip(self._days, self._apparatus.tolist(), strict=True))
        told = [self._told(i, self._all, self._all.clocks[day, of]) for i, (day, of) in each]
        return np.asarray(self.fronts.radius - np.array(told))

    def tell_measured(self, number: int) -> Told:
        """Returns the front of a measured test, told without its day."""
        test, day = self.fronts.tests[number], self._days[number]
        middle = self._told(number, self._without[day])
        return self._within(test, middle, self._days != day)

    def fill(self, tests: Sequence[Test], seeds: Sequence[int]) -> None:
        """Pours what `tell` will be asked for, several at once."""
        asked = [(test, self._values(apparatus(test)), seeds) for test in tests]
        self._columns.fill("columns that were not measured: pours", asked)

    def tell(self, test: Test, seeds: Sequence[int]) -> Told:
        """Returns the front of a test that was not measured, from pours of its own.

        Raises:
            ValueError: fewer than two of its pours are usable.
        """
        of = apparatus(test)
        rows = self._columns.fronts(test, self._values(of), seeds)
        if len(rows) < 2:
            raise ValueError(f"{len(rows)} of {len(seeds)} pours are usable, two are needed")
        middle = _seen(_late(times_of(test), rows.mean(axis=0), self._all.clock(of)))
        return self._within(test, middle, np.full(len(self._days), True))

    def _values(self, of: int) -> Array:
        return UNKNOWN.from_unconstrained(self._all.u[of][None])[0]

    def _emulate(self, tests: list[Test], name: str) -> dict[str, Emulated]:
        """Emulators of one pour at each point, by the code of the test."""
        points = np.asarray(qmc.Sobol(len(UNKNOWN.names), rng=_DESIGN_SEED).random(POINTS))
        values = UNKNOWN.from_unconstrained(points)
        asked = [(test, number) for test in tests for number in range(POINTS)]
        fronts: dict[str, list[Array]] = {test.code: [] for test in tests}
        kept: dict[str, list[int]] = {test.code: [] for test in tests}
        columns = self._columns
        columns.fill(f"{name}: pours", [(test, values[i], [i]) for test, i in asked])
        for test, number in asked:
            for front in columns.fronts(test, values[number], [number]):
                fronts[test.code].append(front)
                kept[test.code].append(number)
        return {
            test.code: Emulated.of(test, points[kept[test.code]], np.array(fronts[test.code]))
            for test in tests
        }

    def _told(self, number: int, fit: _Fit, clock: float | None = None) -> Array:
        one, of = self.emulated[number], int(self._apparatus[number])
        late = fit.clock(of) if clock is None else clock
        return _seen(_late(one.times, one.at(fit.u[of]), late))

    def _fit(self, keep: NDArray[np.bool_]) -> _Fit:
        """The most probable numbers and clocks, given the tests for which `keep` (n,) holds."""
        days = sorted(set(zip(self._days[keep], self._apparatus[keep].tolist(), strict=True)))
        parts = []
        for i in np.flatnonzero(keep).tolist():
            front, of = self.fronts.radius[i, :-1], int(self._apparatus[i])
            used = np.isfinite(front) & (front > _TUBE + _OWN)
            error = np.hypot(_OWN, self.emulated[i].error[:-1][used])
            scale = error * max(1.0, sqrt(used.sum() / _COUNT))
            parts.append((i, of, days.index((self._days[i], of)), used, front[used], scale))

        def residuals(p: Array) -> Array:
            u, clocks = _both(p[:_COORDINATES]), (_CLOCK * p[_COORDINATES:]).tolist()
            left = [(p[:_COORDINATES] - 0.5) * sqrt(12.0), p[_COORDINATES:]]
            for i, of, day, used, front, scale in parts:
                one = self.emulated[i]
                told = _late(one.times, one.at(u[of]), clocks[day])[:-1]
                left.append((told[used] - front) / scale)
            return np.concatenate(left)

        clock = np.full(len(days), np.inf)
        low = np.append(np.zeros(_COORDINATES), -clock)
        high = np.append(np.ones(_COORDINATES), clock)
        starts = qmc.Sobol(_COORDINATES, rng=_DESIGN_SEED + 1).random(_STARTS)
        found = [
            least_squares(residuals, np.append(u, np.zeros(len(days))), bounds=(low, high))
            for u in starts
        ]
        best = min(found, key=lambda one: one.cost).x
        clocks = (_CLOCK * best[_COORDINATES:]).tolist()
        return _Fit(_both(best[:_COORDINATES]), dict(zip(days, clocks, strict=True)))

    def _within(self, test: Test, middle: Array, others: NDArray[np.bool_]) -> Told:
        """With the error of the rows for which `others` (n,) holds, of the test's apparatus."""
        of = apparatus(test)
        others = others & (self._apparatus == of)
        square = np.nanmean(self.gaps[others] ** 2, axis=0)
        # In units of free fall a clock is off by more where gravity is stronger.
        gravity = np.mean([t.numbers["N"] for t in self.fronts.tests if apparatus(t) == of])
        share = max(0.0, 1.0 - float(gravity) / test.numbers["N"])
        late = np.std(list(self.clocks(of).values()))
        drift = late * np.append(np.gradient(middle[:-1], times_of(test)), 0.0)
        return Told.of(middle, np.sqrt(square + share * drift**2))


def apparatus(test: Test) -> int:
    """Returns 0 for the bench, 1 for the centrifuge."""
    return int(test.numbers["N"] > 1.0)


def with_own_clock(test: Test, seen: Array, told: Array) -> Array:
    """Returns what a told front leaves of a seen one at the test's best clock, shape (T,).

    The clock is within 60 ms: what is left is the form of the front and not when it was released.
    """
    clocks = np.arange(-3.0, 3.01, 0.1) * _CLOCK
    left = [(seen - _seen(_late(times_of(test), told, clock)))[:-1] for clock in clocks.tolist()]
    return min(left, key=lambda one: float(np.nanmean(one**2)))


def _both(u: Array) -> Array:
    """Coordinates of both apparatuses, shape (2, 6): the beads are the same."""
    beads, own = u[:_OF_BEADS], u[_OF_BEADS:].reshape(2, -1)
    return np.array([np.append(beads, its) for its in own])


def _late(times: Array, front: Array, clock: float) -> Array:
    """A front (T + 1,) as a clock sees it that is late by so much [s]; the end stays."""
    known = np.concatenate([[0.0], times]), np.concatenate([[_COLUMN], front[:-1]])
    return np.append(np.interp(times - clock, *known), front[-1])


def _seen(front: Array) -> Array:
    """No less than the tube."""
    return np.maximum(front, _TUBE)
