r"""Fronts of columns without any physics of grains: told from the other tests.

| model | front of a test |
|---|---|
| `nearest` | that of the nearest test: gravity before beads before viscosity |
| `line` | the least-squares plane in gravity (if tests differ in it), beads and viscosity |
| `between` | a Gaussian process over the same, with what tests of one day share |

Viscosity counts in units of free fall, $\log_{10} (\mu / \sqrt N)$. How a front goes on with
gravity cannot be told from two gravities: three forms, $\ln N$, $1 - N^{-1/2}$ and $1 - 1 / N$,
each scaled to 1 at the strongest gravity that was measured, are averaged, and what they differ by
is part of the error.

The 90 % interval of a row is $\pm 1.645 f s$; s is the row's own error, f the root of the mean
square of error / s with which the row told each measured test from those of other days, or, for a
gravity at which nothing was measured, from those of the other gravities. A measured test is told
from tests of other days alone; but the covariance of `between`, the scatter in s and f, through how
the others are told, know all tests. No front is told beyond what the cameras see.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.predictions.column_tests import Fronts, Test
from granulcal.experiments.predictions.interval import HALF_90

__all__ = ["MODELS", "BetweenTests", "Told", "held"]

Array = NDArray[np.float64]

# Standard deviations over the tests' scatter, most probable for the 20 measured tests of 8 and
# 6 mm: of a constant, gravity, beads, both, viscosity, viscosity by gravity, clay, day, one test.
_CONSTANT, _GRAVITY, _BEADS, _BOTH = 0.65, 0.71, 1.21, 0.41
_VISCOSITY, _BY_GRAVITY, _CLAY, _DAY, _NOISE = 0.30, 0.45, 0.37, 0.45, 0.50
# Powers of 1 / N; 0 is the logarithm.
_POWERS = (0.0, 0.5, 1.0)
_PLANE_POWER = 0.5
# Least scatter of the tests at one time, and what the cameras see [mm].
_LEAST, _SEEN = 1.0, 200.0


@dataclass(frozen=True)
class Told:
    """A row's fronts of one test, at its times and at the end [mm], shape (T + 1,) each."""

    middle: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, middle: Array, sd: Array) -> "Told":
        """Returns the 90 % interval about `middle`, none of it beyond what the cameras see."""
        half = HALF_90 * sd
        low, middle, high = (np.minimum(v, _SEEN) for v in (middle - half, middle, middle + half))
        return cls(middle, low, high)

    @property
    def sd(self) -> Array:
        """Standard deviation [mm]; of the lower end, for the upper one stops where cameras do."""
        return np.asarray((self.middle - self.low) / HALF_90)


@dataclass(frozen=True)
class _Setting:
    """What a row knows of n tests; arrays of shape (n,)."""

    gravity: Array
    beads: Array
    viscosity: Array
    clay: Array
    day: NDArray[np.str_]

    @classmethod
    def of(cls, tests: tuple[Test, ...]) -> "_Setting":
        gravity = np.array([t.numbers["N"] for t in tests])
        viscosity = np.array([t.numbers["mu_f"] for t in tests]) / np.sqrt(gravity)
        return cls(
            gravity=gravity,
            beads=(8e-3 - np.array([t.numbers["d_p"] for t in tests])) / 2e-3,
            viscosity=np.log10(viscosity / 1e-3),
            clay=np.array([float(t.fluid == "k") for t in tests]),
            day=np.array([t.campaign for t in tests]),
        )


class BetweenTests:
    """The rows without physics.

    Args:
        fronts: of the measured tests.
    """

    def __init__(self, fronts: Fronts) -> None:
        """Reads the measured fronts and finds with which errors they tell each other."""
        self.fronts = fronts
        scatter = np.nanstd(fronts.radius, axis=0)
        self.spread: Array = np.maximum(np.nan_to_num(scatter), _LEAST)
        setting = _Setting.of(fronts.tests)
        self._days, self._gravities = setting.day, setting.gravity
        self._errors = {name: self._of(name, self._days) for name in MODELS}
        self._far = {name: self._of(name, self._gravities) for name in MODELS}

    def tell(self, model: str, test: Test, *, far: bool = False) -> Told:
        """Returns what one of `MODELS` says of a test, measured or not.

        `far` leaves out all tests of its gravity, too.
        """
        keep = self._days != test.campaign
        if test.code not in {one.code for one in self.fronts.tests}:
            keep = np.full(len(self._days), True)
        if far:
            keep &= self._gravities != test.numbers["N"]
        known = self.fronts.where(keep)
        middle, sd = MODELS[model](known, test, self.spread)
        is_far = test.numbers["N"] not in self._gravities[keep]
        others = self._days != test.campaign
        factor = _root(self._errors[model][others])
        if is_far:
            factor = max(factor, _root(self._far[model][others]))
        return Told.of(middle, factor * sd)

    def held(self, model: str, *, far: bool = False) -> tuple[float, float, float]:
        """Returns root mean square error [mm] over the times and at the end, and the share held.

        Over all measured tests, each told without those of its day (`far`: of its gravity).
        """
        told = [self.tell(model, test, far=far) for test in self.fronts.tests]
        return held(self.fronts.radius, told)

    def _of(self, name: str, groups: NDArray[np.generic]) -> Array:
        """Errors over the row's own s, each group told from the others, shape (n, T + 1)."""
        found = np.full(self.fronts.radius.shape, np.nan)
        for i, test in enumerate(self.fronts.tests):
            known = self.fronts.where(groups != groups[i])
            if known.tests:
                middle, sd = MODELS[name](known, test, self.spread)
                found[i] = (self.fronts.radius[i] - middle) / sd
        return found


def held(seen: Array, told: Sequence[Told]) -> tuple[float, float, float]:
    """Returns root mean square error [mm] over the times and at the end, and the share held.

    Args:
        seen: measured fronts, shape (n, T + 1).
        told: what was told of each.
    """
    gap = seen - np.array([one.middle for one in told])
    inside = (seen >= np.array([one.low for one in told])) & (
        seen <= np.array([one.high for one in told])
    )
    share = float(inside[np.isfinite(seen)].mean())
    return _root(gap[:, :-1]), _root(gap[:, -1]), share


def _root(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _nearest(known: Fronts, test: Test, spread: Array) -> tuple[Array, Array]:
    there, own = _Setting.of(known.tests), _Setting.of((test,))
    # A gravity further off outweighs any other size of beads, and that any other viscosity.
    gap = 100.0 * np.abs(np.log(there.gravity / own.gravity))
    gap += 10.0 * np.abs(there.beads - own.beads) + np.abs(there.viscosity - own.viscosity)
    gap += np.abs(there.clay - own.clay)
    return known.radius[int(np.argmin(gap))], spread


def _line(known: Fronts, test: Test, spread: Array) -> tuple[Array, Array]:
    there, own = _Setting.of(known.tests), _Setting.of((test,))
    strongest = float(there.gravity.max())

    def columns(s: _Setting) -> Array:
        found = [np.ones(len(s.gravity)), s.beads, s.viscosity]
        if len(set(there.gravity.tolist())) > 1:
            found.append(_form(s.gravity, _PLANE_POWER, strongest))
        return np.column_stack(found)

    a, b = columns(there), columns(own)[0]
    middle, sd = np.full(len(spread), np.nan), np.full(len(spread), np.nan)
    for j in range(len(spread)):
        seen = np.isfinite(known.radius[:, j])
        if not seen.any():
            continue
        weights = np.linalg.pinv(a[seen]).T @ b
        middle[j] = weights @ known.radius[seen, j]
        sd[j] = spread[j] * np.sqrt(1.0 + weights @ weights)
    return middle, sd


def _between(known: Fronts, test: Test, spread: Array) -> tuple[Array, Array]:
    means, variances = [], []
    for power in _POWERS:
        mean, variance = _process(known, test, spread, power)
        means.append(mean)
        variances.append(variance)
    variance = np.mean(variances, axis=0) + np.var(means, axis=0)
    return np.asarray(np.mean(means, axis=0)), np.sqrt(variance)


def _process(known: Fronts, test: Test, spread: Array, power: float) -> tuple[Array, Array]:
    """Mean and variance of a Gaussian process at one form of gravity, (T + 1,) each."""
    there, own = _Setting.of(known.tests), _Setting.of((test,))
    strongest = float(there.gravity.max())
    k = _covariance(there, there, power, strongest) + _NOISE**2 * np.eye(len(known.tests))
    cross = _covariance(own, there, power, strongest)[0]
    prior = float(_covariance(own, own, power, strongest)[0, 0]) + _NOISE**2
    mean, variance = np.full(len(spread), np.nan), np.full(len(spread), np.nan)
    for j in range(len(spread)):
        seen = np.isfinite(known.radius[:, j])
        if not seen.any():
            continue
        y = known.radius[seen, j]
        weights = np.linalg.solve(k[np.ix_(seen, seen)], cross[seen])
        mean[j] = y.mean() + weights @ (y - y.mean())
        variance[j] = spread[j] ** 2 * (prior - weights @ cross[seen])
    return mean, variance


def _covariance(a: _Setting, b: _Setting, power: float, strongest: float) -> Array:
    g, h = (_form(s.gravity, power, strongest) for s in (a, b))
    gravity, beads = np.outer(g, h), np.outer(a.beads, b.beads)
    alike = np.exp(-0.5 * (a.viscosity[:, None] - b.viscosity) ** 2)
    near = np.exp(-0.5 * (g[:, None] - h) ** 2)
    found = _CONSTANT**2 + _GRAVITY**2 * gravity + _BEADS**2 * beads + _BOTH**2 * gravity * beads
    found += alike * (_VISCOSITY**2 + _BY_GRAVITY**2 * near)
    found += _CLAY**2 * np.outer(a.clay, b.clay) + _DAY**2 * (a.day[:, None] == b.day)
    return np.asarray(found, dtype=np.float64)


def _form(gravity: Array, power: float, strongest: float) -> Array:
    """0 at one g, 1 at the strongest that was measured."""
    if strongest <= 1.0:
        return np.asarray(np.log(gravity), dtype=np.float64)
    if power == 0.0:
        return np.asarray(np.log(gravity) / np.log(strongest), dtype=np.float64)
    return np.asarray((1 - gravity**-power) / (1 - strongest**-power), dtype=np.float64)


MODELS: dict[str, Callable[[Fronts, Test, Array], tuple[Array, Array]]] = {
    "nearest": _nearest,
    "line": _line,
    "between": _between,
}
"""Rows by name: known fronts, the test, the scatter; middle and own error [mm]."""
