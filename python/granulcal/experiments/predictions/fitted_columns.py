"""Fronts of columns by models that are fitted to the measured tests (`column_fit.py`).

| model | front of a test |
|---|---|
| `sheared`, `saturated`, `dry` | that of beads with and without their liquid (`column_pours.py`) |
| `both` | `sheared` and `between` at equal weights |

A measured test is told without those of its day, and so are the rows without physics beside it. How
far that is from what was seen is said twice: as told, and at each test's own clock, which nobody
can tell beforehand.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.predictions.between_tests import MODELS as WITHOUT_PHYSICS
from granulcal.experiments.predictions.between_tests import BetweenTests, Told, held
from granulcal.experiments.predictions.column_fit import (
    APPARATUS,
    POINTS,
    ColumnFit,
    apparatus,
    with_own_clock,
)
from granulcal.experiments.predictions.column_pours import (
    LIQUIDS,
    UNKNOWN,
    ColumnPours,
    column_scene,
)
from granulcal.experiments.predictions.column_tests import Fronts, Test, all_tests, read_fronts
from granulcal.experiments.predictions.columns import rows_of
from granulcal.pours.pour_time import PourKind

__all__ = [
    "FURTHER_SEEDS",
    "fitted_rows",
    "half_and_half",
    "poured_of_columns",
    "say_fitted",
]

Array = NDArray[np.float64]

FURTHER_SEEDS = range(POINTS, POINTS + 4)
"""Pours of a test that was not measured."""


def fitted_rows(data: Path, pours: Path, *, say: Callable[[str], None]) -> list[tuple[object, ...]]:
    """Returns rows of each of `LIQUIDS`, fitted to the measured tests, and of `both`.

    A measured test is told without those of its day.
    """
    fronts, tests = read_fronts(data), all_tests(data)
    told = {model: _fitted(model, fronts, tests, pours, say) for model in LIQUIDS}
    without_physics = BetweenTests(fronts)
    for model in WITHOUT_PHYSICS:
        told[model] = {test.code: without_physics.tell(model, test) for test in tests}
    told["both"] = {
        code: half_and_half(one, told["between"][code]) for code, one in told["sheared"].items()
    }
    for model, each in told.items():
        _say_held(model, fronts, [each[test.code] for test in fronts.tests], say)
    return [
        row
        for model in ("both", *LIQUIDS)
        for test in tests
        if test.code in told[model]
        for row in rows_of(model, test, told[model][test.code])
    ]


def say_fitted(model: str, data: Path, pours: Path) -> None:
    """Prints what `fitted_rows` says of a model, of one that has no rows, too.

    Args:
        model: of `column_pours.py`.
        data: measured data.
        pours: folder of the pours that are kept.
    """
    fronts = read_fronts(data)
    told = _fitted(model, fronts, list(fronts.tests), pours, print)
    _say_held(model, fronts, [told[test.code] for test in fronts.tests], print)


def poured_of_columns(data: Path) -> list[PourKind]:
    """Returns what `fitted_rows` pours, at most."""
    measured, tests = read_fronts(data).tests, all_tests(data)
    count = POINTS * len(measured) + len(FURTHER_SEEDS) * (len(tests) - len(measured))
    return [
        PourKind(f"columns, {model}", column_scene(measured[0], model), UNKNOWN, count)
        for model in LIQUIDS
    ]


def half_and_half(one: Told, other: Told) -> Told:
    """Returns what two rows say together: the mixture of both normals at equal weights."""
    middle = 0.5 * (one.middle + other.middle)
    square = 0.5 * (one.sd**2 + other.sd**2) + 0.25 * (one.middle - other.middle) ** 2
    return Told.of(middle, np.sqrt(square))


def _fitted(
    model: str,
    fronts: Fronts,
    tests: list[Test],
    pours: Path,
    say: Callable[[str], None],
) -> dict[str, Told]:
    """Returns what a model says of every test of which two pours are usable."""
    fit = ColumnFit(fronts, ColumnPours(pours, model), model)
    told = {test.code: fit.tell_measured(i) for i, test in enumerate(fronts.tests)}
    others, seeds = [test for test in tests if test.code not in told], FURTHER_SEEDS
    fit.fill(others, seeds)
    for test in others:
        try:
            told[test.code] = fit.tell(test, seeds)
        except ValueError as error:
            say(f"columns, {model} of {test.code}: no prediction: {error}")
    _say_fit(model, fit, say)
    return told


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
        each = np.flatnonzero(keep).tolist()
        if not each:
            continue
        error, end, share = held(fronts.radius[each], [told[i] for i in each])
        form = [
            with_own_clock(fronts.tests[i], fronts.radius[i], told[i].middle).tolist() for i in each
        ]
        say(
            f"columns, {name},{where} without the tests of its day: rms {error:.1f} mm, with "
            f"each test's own clock {_root(np.array(form)):.1f} mm, at the end {end:.1f} mm; "
            f"{share:.0%} in the 90 % intervals"
        )


def _root(gaps: Array) -> float:
    return float(np.sqrt(np.nanmean(gaps**2)))
