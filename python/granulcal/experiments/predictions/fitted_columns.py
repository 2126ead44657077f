"""Fronts of columns by models that are fitted to the measured tests (`column_fit.py`).

A measured test is told without those of its day, and so are the rows without physics beside it. How
far that is from what was seen is said twice: as told, and at each test's own clock, which nobody
can tell beforehand.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.predictions.between_tests import MODELS as WITHOUT_PHYSICS
from granulcal.experiments.predictions.between_tests import BetweenTests, Told
from granulcal.experiments.predictions.column_fit import (
    APPARATUS,
    POINTS,
    ColumnFit,
    apparatus,
    with_own_clock,
)
from granulcal.experiments.predictions.column_pours import LIQUIDS, ColumnPours
from granulcal.experiments.predictions.column_tests import Fronts, all_tests, read_fronts
from granulcal.experiments.predictions.columns import rows_of

__all__ = ["fitted_rows"]

Array = NDArray[np.float64]

# Of a test that was not measured.
_POURS = 4


def fitted_rows(data: Path, pours: Path, *, say: Callable[[str], None]) -> list[tuple[object, ...]]:
    """Returns rows of each of `LIQUIDS`, fitted to the measured tests.

    A measured test is told without those of its day.
    """
    fronts, tests = read_fronts(data), all_tests(data)
    measured = {test.code: number for number, test in enumerate(fronts.tests)}
    rows = list[tuple[object, ...]]()
    for model in LIQUIDS:
        fit = ColumnFit(fronts, ColumnPours(pours, model), model)
        told = {code: fit.tell_measured(number) for code, number in measured.items()}
        for test in tests:
            if test.code in told:
                continue
            try:
                told[test.code] = fit.tell(test, range(POINTS, POINTS + _POURS))
            except ValueError as error:
                say(f"columns, {model} of {test.code}: no prediction: {error}")
        _say_fit(model, fit, say)
        _say_held(model, fronts, [told[code] for code in measured], say)
        rows += [row for t in tests if t.code in told for row in rows_of(model, t, told[t.code])]
    without_physics = BetweenTests(fronts)
    for model in WITHOUT_PHYSICS:
        told_so = [without_physics.tell(model, test) for test in fronts.tests]
        _say_held(model, fronts, told_so, say)
    return rows


def _say_fit(model: str, fit: ColumnFit, say: Callable[[str], None]) -> None:
    left = fit.fitted()[:, :-1]
    say(f"columns, {model}: the fit leaves {_root(left):.1f} mm rms")
    for of, name in enumerate(APPARATUS):
        numbers = ", ".join(f"{path} {value:.3g}" for path, value in fit.unknown(of).items())
        say(f"columns, {model}, {name}: {numbers}")
        late = ", ".join(f"{day} {1e3 * clock:.0f}" for day, clock in fit.clocks(of).items())
        say(f"columns, {model}, {name}: clocks late by [ms] {late}")


def _say_held(name: str, fronts: Fronts, told: list[Told], say: Callable[[str], None]) -> None:
    """Says how far measured tests are from what is told of them without those of their day."""
    its = np.array([apparatus(test) for test in fronts.tests])
    parts = [("", np.full(len(told), True))]
    parts += [(f" {where}", its == of) for of, where in enumerate(APPARATUS)]
    parts.append((" liquids but clay", np.array([test.fluid != "k" for test in fronts.tests])))
    for where, keep in parts:
        each = [number for number in np.flatnonzero(keep).tolist()]
        if not each:
            continue
        seen = fronts.radius[each]
        gaps = seen - np.array([told[i].middle for i in each])
        inside = (seen >= np.array([told[i].low for i in each])) & (
            seen <= np.array([told[i].high for i in each])
        )
        form = [
            with_own_clock(fronts.tests[i], fronts.radius[i], told[i].middle).tolist() for i in each
        ]
        say(
            f"columns, {name},{where} without the tests of its day: rms {_root(gaps[:, :-1]):.1f} "
            f"mm, with each test's own clock {_root(np.array(form)):.1f} mm, at the end "
            f"{_root(gaps[:, -1]):.1f} mm; {inside[np.isfinite(seen)].mean():.0%} in the 90 % "
            "intervals"
        )


def _root(gaps: Array) -> float:
    return float(np.sqrt(np.nanmean(gaps**2)))
