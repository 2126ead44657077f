"""Columns that hold their liquid: what a pour of a test has of it, and fits that know some days."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.experiments.predictions.between_tests import Told
from granulcal.experiments.predictions.column_fit import ColumnFit, Emulated
from granulcal.experiments.predictions.column_pours import UNKNOWN, ColumnPours
from granulcal.experiments.predictions.column_tests import Fronts, Test, times_of
from granulcal.experiments.predictions.fitted_columns import fitted_rows, half_and_half

Array = NDArray[np.float64]
TRUTH = np.array([0.3, 0.6, 0.5, 0.4, 0.7, 0.5])
LATE = {"20210101": 0.012, "20210102": -0.015, "20210103": 0.004, "20210104": 0.0}


def one(day: str, gravity: float, viscosity: float, beads: float = 8e-3) -> Test:
    numbers = {"N": gravity, "G": 9.81 * gravity, "d_p": beads, "rho_p": 2632.0}
    liquid = {"rho_f": 1100.0, "mu_f": viscosity, "H_f0": 0.05, "sigma_f": 0.07}
    return Test(f"{day}_{viscosity}", {**numbers, **liquid})


def front(test: Test, u: Array) -> Array:
    """Fronts [mm] that a quadratic polynomial has, faster or slower with two of the unknowns."""
    times = np.append(times_of(test), times_of(test)[-1]) * test.numbers["N"] ** 0.5
    speed = 300.0 - 80.0 * u[0] + 60.0 * u[3] - 20.0 * np.log10(test.numbers["mu_f"] / 1e-3)
    return np.asarray(54.0 + speed * times - 200.0 * u[4] * times**2 * (0.5 + u[0]))


class Closed(ColumnPours):
    """Pours whose fronts are known."""

    def fill(self, what: str, asked: object) -> None:
        """Nothing is poured beforehand."""

    def fronts(self, test: Test, unknown: Array, seeds: Sequence[int]) -> Array:
        u = UNKNOWN.to_unconstrained(unknown[None])[0]
        return np.array([front(test, u) for _ in seeds])


def measured() -> Fronts:
    """Two tests of each of four days, seen by clocks of their own."""
    tests, rows = [], []
    for day, late in LATE.items():
        for viscosity in (1e-3, 5e-2):
            test = one(day, 4.6, viscosity)
            shown = front(test, TRUTH)
            times = np.concatenate([[0.0], times_of(test)])
            seen = np.interp(times_of(test) - late, times, np.concatenate([[54.0], shown[:-1]]))
            tests.append(test)
            rows.append(np.maximum(np.append(seen, shown[-1]), 62.0))
    return Fronts(tuple(tests), np.array(rows))


@pytest.fixture(scope="module")
def fit(tmp_path_factory: pytest.TempPathFactory) -> ColumnFit:
    return ColumnFit(measured(), Closed(tmp_path_factory.mktemp("pours"), "saturated"), "bench")


def test_clocks_and_fronts_are_found_again(fit: ColumnFit) -> None:
    gaps = fit.fitted()
    # A clock's prior holds it back by a little, and times before the tube is passed are not fitted.
    assert np.sqrt(np.mean(gaps**2)) < 1.5
    shifts = np.array([fit.clocks(1)[day] - late for day, late in LATE.items()])
    # What all clocks share a faster tube can be, too.
    assert np.ptp(shifts) < 0.004
    assert set(fit.unknown(1)) == set(UNKNOWN.names)


def test_a_day_is_told_without_itself(fit: ColumnFit) -> None:
    day = [test.campaign for test in fit.fronts.tests].index("20210102")
    told = fit.tell_measured(day)
    error = told.middle - fit.fronts.radius[day]
    # Its clock, which no other day tells, is what it is off by; its interval knows the others'.
    assert 2.0 < np.abs(error[:-1]).max() < 20.0
    assert np.all(told.low <= told.middle) and np.all(told.middle <= told.high)
    changed = Fronts(fit.fronts.tests, fit.fronts.radius.copy())
    same_day = [test.campaign == "20210102" for test in changed.tests]
    changed.radius[same_day] += 15.0
    again = ColumnFit(changed, Closed(Path("unused"), "saturated"), "bench").tell_measured(day)
    assert again.middle == pytest.approx(told.middle)


def test_a_further_test_is_wider_where_clocks_matter_more(fit: ColumnFit) -> None:
    near, far = (fit.tell(one("20220101", gravity, 1e-2), [1, 2]) for gravity in (4.6, 28.0))
    assert near.middle == pytest.approx(far.middle, abs=12.0)
    assert np.all((far.high - far.low)[4:-1] > (near.high - near.low)[4:-1])
    assert np.all(near.middle >= 62.0) and np.all(near.high <= 200.0)
    with pytest.raises(ValueError, match="1 of 1 pours are usable, two are needed"):
        fit.tell(one("20220101", 4.6, 1e-2), [1])


def test_an_emulator_reproduces_a_polynomial_and_says_what_it_is_off_by() -> None:
    points = np.random.default_rng(1).random((60, 6))
    test = one("20210101", 1.0, 1e-3)
    rows = np.array([front(test, u) for u in points])
    noisy = rows + np.random.default_rng(2).normal(0.0, 3.0, rows.shape)
    exact, off = Emulated.of(test, points, rows), Emulated.of(test, points, noisy)
    assert exact.error.max() < 0.5 and 2.0 < np.median(off.error) < 7.0
    assert exact.at(TRUTH) == pytest.approx(front(test, TRUTH), abs=1.0)


def test_two_rows_together_are_as_wide_as_they_disagree() -> None:
    one, other = (Told(np.array([v]), np.array([v - 3.29]), np.array([v])) for v in (100.0, 110.0))
    both = half_and_half(one, other)
    assert both.middle == 105.0
    # Variances of 4 each, and 25 for the means.
    assert both.middle - both.low == pytest.approx(1.645 * np.sqrt(29.0))
    assert half_and_half(one, one).low == pytest.approx(one.low)


def test_a_pour_has_the_liquid_and_the_free_fall_of_its_test(tmp_path: Path) -> None:
    columns = ColumnPours(tmp_path / "pours", "sheared")
    slow, fast = columns.scene(one("a", 1.0, 1e-3)), columns.scene(one("a", 25.0, 5e-2, 6e-3))
    assert fast.get("effects.fluid.viscosity") == fast.get("effects.lubrication.viscosity") == 5e-2
    assert fast.get("effects.fluid.saturated") == fast.get("effects.lubrication.shear") == 1.0
    clay = Test("a_k", {**one("a", 1.0, 0.1).numbers, "C_v": 0.08}, "k")
    # Clay thins with shear: thick as a whole, thin between beads.
    assert columns.scene(clay).get("effects.fluid.viscosity") == 0.1
    assert columns.scene(clay).get("effects.lubrication.viscosity") == pytest.approx(1.2e-3)
    without = ColumnPours(tmp_path / "pours", "saturated").scene(one("a", 1.0, 1e-3))
    assert without.get("effects.lubrication.shear") == 0.0
    dry = ColumnPours(tmp_path, "dry").scene(one("a", 1.0, 1e-3))
    assert dry.get("effects.fluid.density") == 0.0
    flows = ColumnPours(tmp_path / "pours", "slipping").scene(one("a", 25.0, 5e-2, 6e-3))
    assert flows.get("effects.liquid.viscosity") == 5e-2
    assert flows.get("effects.liquid.tension") == 0.07
    assert flows.get("effects.liquid.begin") == flows.get("walls.0.motion.begin")
    assert flows.get("effects.fluid.density") == 0.0
    assert fast.get("gravity.2") == -9.81 * 25
    for path in ("substep", "end.horizon", "observe.begin", "walls.0.motion.begin"):
        assert fast.get(path) == pytest.approx(slow.get(path) / 5.0), path
    assert fast.get("grains.count") == round(slow.get("grains.count") * (8 / 6) ** 3)
    unknown = UNKNOWN.from_unconstrained(TRUTH[None])[0]
    (row,) = columns.fronts(one("a", 1.0, 1e-3), unknown, [1])
    # From the tube's radius outwards, and the end is the farthest.
    assert 50.0 < row[0] < 62.0 < row[10] <= row[-1] < 250.0
    assert columns.fronts(one("a", 1.0, 1e-3), unknown, [1]) == pytest.approx(row[None])


def test_rows_of_an_empty_folder_name_the_file(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="Experimental_Conditions"):
        fitted_rows(tmp_path, tmp_path / "pours", say=print)
