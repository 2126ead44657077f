r"""One set of numbers for the columns of one apparatus, and how it tells other days.

The fronts $f_i(u, t)$ of a measured test i are emulated by a quadratic polynomial in the six
coordinates u of `UNKNOWN`, from one pour each at points of a Sobol sequence. With a clock $c$ for
each day,

$$ \min_{u, c} \sum_{i, t} \frac{(f_i(u, t - c_i) - r_i(t))^2}{(s^2 + e_i(t)^2)\, \max(1, T_i / 4)}
   + \sum_{day} c^2 / s_c^2 $$

with the error e of the emulator (leave one out), s = 5 mm and s_c = 20 ms: the $T_i$ times of one
front count as four. Until the beads have come out from under the tube all that is seen is the tube,
and such times are not fitted.

A test is told by the fit without its day, at the mean clock of the other days. The error of a row
is the root mean square of what such rows are off by, at equal times of free fall, and what the
scatter of the clocks does where gravity is stronger than in the tests that tell the error.
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
from granulcal.progress import steps

__all__ = ["POINTS", "ColumnFit", "Emulated"]

Array = NDArray[np.float64]

POINTS = 64
"""Pours of each measured test."""
_DESIGN_SEED = 5
# One sd of the model's own error [mm] and of a day's clock [s]; times of a front that count.
_OWN, _CLOCK, _COUNT = 5.0, 0.02, 4.0
# Radius of the column, and of what is seen of the tube about it; what the cameras see [mm].
_COLUMN, _TUBE, _SEEN = 54.0, 62.0, 200.0
_STARTS = 8
_HALF = 1.645


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


class ColumnFit:
    """The fits of one apparatus: of all its days, and without each of them.

    Args:
        fronts: its measured tests.
        columns: their pours.
        name: of the apparatus, for the progress.
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
        everything = np.full(len(self._days), True)
        self._all = self._fit(everything)
        self._without = {day: self._fit(self._days != day) for day in sorted(set(self._days))}
        gaps = [
            row - self._told(i, self._without[day])
            for i, (row, day) in enumerate(zip(fronts.radius, self._days, strict=True))
        ]
        self.gaps: Array = np.array(gaps)
        self.clock_sd = float(np.std(list(self._all.clocks.values())))

    @property
    def unknown(self) -> dict[str, float]:
        """Values of `UNKNOWN` of the fit to all days."""
        values = UNKNOWN.from_unconstrained(self._all.u[None])[0].tolist()
        return dict(zip(UNKNOWN.names, values, strict=True))

    @property
    def clocks(self) -> dict[str, float]:
        """What each day's clock is late by [s]."""
        return self._all.clocks

    def fitted(self) -> Array:
        """Returns what the fit to all days leaves of the measured fronts [mm], shape (n, T + 1)."""
        told = [self._told(i, self._all, self.clocks[day]) for i, day in enumerate(self._days)]
        return np.asarray(self.fronts.radius - np.array(told))

    def tell_measured(self, number: int) -> Told:
        """Returns the front of a measured test, told without its day."""
        day = self._days[number]
        middle = self._told(number, self._without[day])
        return self._within(self.fronts.tests[number], middle, self._days != day)

    def tell(self, test: Test, seeds: Sequence[int]) -> Told:
        """Returns the front of a test that was not measured, from pours of its own.

        Raises:
            ValueError: fewer than two of its pours are usable.
        """
        unknown = UNKNOWN.from_unconstrained(self._all.u[None])[0]
        rows = self._columns.fronts(test, unknown, seeds)
        if len(rows) < 2:
            raise ValueError(f"{len(rows)} of {len(seeds)} pours are usable, two are needed")
        middle = _seen(_late(times_of(test), rows.mean(axis=0), self._all.clock))
        return self._within(test, middle, np.full(len(self._days), True))

    def _emulate(self, tests: list[Test], name: str) -> dict[str, Emulated]:
        """Emulators of one pour at each point, by the code of the test."""
        points = np.asarray(qmc.Sobol(len(UNKNOWN.names), rng=_DESIGN_SEED).random(POINTS))
        values = UNKNOWN.from_unconstrained(points)
        asked = [(test, number) for test in tests for number in range(POINTS)]
        fronts: dict[str, list[Array]] = {test.code: [] for test in tests}
        kept: dict[str, list[int]] = {test.code: [] for test in tests}
        for test, number in steps(f"{name}: pours", asked):
            for front in self._columns.fronts(test, values[number], [number]):
                fronts[test.code].append(front)
                kept[test.code].append(number)
        return {
            test.code: Emulated.of(test, points[kept[test.code]], np.array(fronts[test.code]))
            for test in tests
        }

    def _told(self, number: int, fit: "_Fit", clock: float | None = None) -> Array:
        one = self.emulated[number]
        return _seen(_late(one.times, one.at(fit.u), fit.clock if clock is None else clock))

    def _fit(self, keep: NDArray[np.bool_]) -> "_Fit":
        """The most probable numbers and clocks, given the tests for which `keep` (n,) holds."""
        numbers = np.flatnonzero(keep).tolist()
        days = sorted(set(self._days[keep]))
        dimension = len(UNKNOWN.names)
        parts = []
        for i in numbers:
            front = self.fronts.radius[i, :-1]
            used = np.isfinite(front) & (front > _TUBE + _OWN)
            error = np.hypot(_OWN, self.emulated[i].error[:-1][used])
            scale = error * max(1.0, sqrt(used.sum() / _COUNT))
            parts.append((i, days.index(self._days[i]), used, front[used], scale))

        def residuals(p: Array) -> Array:
            u, clocks = p[:dimension], (_CLOCK * p[dimension:]).tolist()
            left = [p[dimension:]]
            for i, day, used, front, scale in parts:
                one = self.emulated[i]
                told = _late(one.times, one.at(u), clocks[day])[:-1]
                left.append((told[used] - front) / scale)
            return np.concatenate(left)

        low = np.concatenate([np.zeros(dimension), np.full(len(days), -np.inf)])
        high = np.concatenate([np.ones(dimension), np.full(len(days), np.inf)])
        starts = qmc.Sobol(dimension, rng=_DESIGN_SEED + 1).random(_STARTS)
        found = [
            least_squares(residuals, np.append(u, np.zeros(len(days))), bounds=(low, high))
            for u in starts
        ]
        best = min(found, key=lambda one: one.cost).x
        clocks = dict(zip(days, (_CLOCK * best[dimension:]).tolist(), strict=True))
        return _Fit(best[:dimension], clocks)

    def _within(self, test: Test, middle: Array, others: NDArray[np.bool_]) -> Told:
        """With the error of the rows for which `others` (n,) holds."""
        gaps = self.gaps[others]
        square = np.nanmean(gaps**2, axis=0)
        # In units of free fall a clock is off by more where gravity is stronger.
        gravity = float(np.mean([t.numbers["N"] for t in self.fronts.tests]))
        share = max(0.0, 1.0 - gravity / test.numbers["N"])
        drift = self.clock_sd * np.append(np.gradient(middle[:-1], times_of(test)), 0.0)
        half = _HALF * np.sqrt(square + share * drift**2)
        low, middle, high = (np.minimum(v, _SEEN) for v in (middle - half, middle, middle + half))
        return Told(middle, low, high)


@dataclass(frozen=True)
class _Fit:
    u: Array
    clocks: dict[str, float]

    @property
    def clock(self) -> float:
        """The mean of all days [s]."""
        return sum(self.clocks.values()) / len(self.clocks)


def _late(times: Array, front: Array, clock: float) -> Array:
    """A front (T + 1,) as a clock sees it that is late by so much [s]; the end stays."""
    known = np.concatenate([[0.0], times]), np.concatenate([[_COLUMN], front[:-1]])
    return np.append(np.interp(times - clock, *known), front[-1])


def _seen(front: Array) -> Array:
    """No less than the tube."""
    return np.maximum(front, _TUBE)
