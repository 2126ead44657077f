"""Fronts of collapsing columns under every test with beads of 8 and 6 mm.

A test states gravity, beads and fluid. The base model takes the beads and the gravity; a named
effect of a fluid takes the fluid's own density and viscosity as well. Their interval is that of
pours at draws of the fit and of the model's own error, which is the root mean square of its
residuals at the same time of the tests that were measured on other days. The rows without physics
are told from the other measured tests (`between_tests.py`) and need no closed loop.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from math import isclose, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.predictions.between_tests import MODELS as WITHOUT_PHYSICS
from granulcal.experiments.predictions.between_tests import BetweenTests, Told
from granulcal.experiments.predictions.column_tests import (
    Test,
    all_tests,
    observing,
    read_fronts,
    times_of,
)
from granulcal.experiments.predictions.model_error import ModelError
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.models import Models
from granulcal.loop.report.prediction import Prediction

__all__ = ["column_rows", "column_rows_without_physics", "rows_of"]

Array = NDArray[np.float64]

# Of each model for each test, at as many draws of the fit.
_POURS = 4
_FLUID = {
    "effects.fluid.density": "rho_f",
    "effects.fluid.viscosity": "mu_f",
    "effects.lubrication.viscosity": "mu_f",
}
_FRONT = re.compile(r"front_radius\[(?P<at>[^\]]+)\]")


def column_rows(
    models: Models, pours: Path, data: Path, *, say: Callable[[str], None]
) -> list[tuple[object, ...]]:
    """Returns rows (model, test, time, radius, low, high) in s and mm; the end's time is `end`."""
    forward, rows = Forward(pours, 1), list[tuple[object, ...]]()
    tests, fronts = all_tests(data), read_fronts(data)
    for model in _simulated_models(models, say):
        found = {t.code: _simulated(models, model, t, forward, say) for t in tests}
        told = {code: one for code, one in found.items() if one is not None}
        error = ModelError(fronts, told)
        rmse, share = error.held(told)
        say(
            f"columns, {model}: measured tests with an rms of {rmse:.1f} mm, {share:.0%} in the "
            "90 % intervals"
        )
        for test in tests:
            if test.code in told:
                rows += rows_of(model, test, error.widened(test, told[test.code]))
    for test in tests:
        rows += _corrected(models, test, forward, say)
    return rows


def column_rows_without_physics(
    data: Path, *, say: Callable[[str], None]
) -> list[tuple[object, ...]]:
    """Returns the same rows of `nearest`, `line` and `between`, told from the other tests."""
    between, rows = BetweenTests(read_fronts(data)), list[tuple[object, ...]]()
    for model in WITHOUT_PHYSICS:
        for far, of in ((False, "day"), (True, "gravity")):
            error, end, share = between.held(model, far=far)
            say(
                f"columns, {model}: measured tests told without those of their {of} with an rms of "
                f"{error:.1f} mm, at the end {end:.1f} mm; {share:.0%} in the 90 % intervals"
            )
    for test in all_tests(data):
        for model in WITHOUT_PHYSICS:
            rows += rows_of(model, test, between.tell(model, test))
    return rows


def _simulated_models(models: Models, say: Callable[[str], None]) -> list[str]:
    if models.makers["named"][0] == models.makers["base"][0]:
        say("columns, named: no rows: the verdict names no model but the base one")
        return ["base"]
    return ["named", "base"]


def _simulated(
    models: Models, model: str, test: Test, forward: Forward, say: Callable[[str], None]
) -> Told | None:
    """Fronts of the model at the test's times and at the end [mm], with the interval of pours."""
    scene = observing(models.scene, times_of(test))
    there = replace(models, scene=scene, names=tuple(scene.observed_names))
    at = test.scene_numbers(models.scene)
    own = models.makers[model][0].numbers
    at |= {path: test.numbers[column] for path, column in _FLUID.items() if path in own}
    try:
        found = there.predict(model, at, forward, pours=_POURS)
    except ValueError as error:
        say(f"columns, {model} of {test.code}: no prediction: {error}")
        return None
    return Told(1e3 * found.middle, 1e3 * found.low, 1e3 * found.high)


def rows_of(model: str, test: Test, told: Told) -> list[tuple[object, ...]]:
    """Returns a row for each time and for the end, in s and mm."""
    times = [*times_of(test).tolist(), "end"]
    columns = zip(times, told.middle, told.low, told.high, strict=True)
    return [(model, test.code, t, float(m), float(a), float(b)) for t, m, a, b in columns]


def _corrected(
    models: Models, test: Test, forward: Forward, say: Callable[[str], None]
) -> list[tuple[object, ...]]:
    """At the times of the fitted conditions, scaled; between them linear."""
    there = {"gravity.2": -test.numbers["G"]}
    try:
        # A residual knows the beads that it is of, and no others.
        fitted, beads = models.scene.get("grains.diameter"), test.numbers["d_p"]
        if not isclose(beads, fitted):
            raise ValueError(f"the fits are of beads of {1e3 * fitted:g} mm, got {1e3 * beads:g}")
        prediction = models.predict("corrected", there, forward, pours=_POURS)
    except ValueError as error:
        say(f"columns, corrected of {test.code}: no prediction: {error}")
        return []
    return _rows("corrected", test, prediction, times_of(test), sqrt(test.numbers["N"]))


def _rows(
    model: str, test: Test, found: Prediction, times: Array, scale: float
) -> list[tuple[object, ...]]:
    """Rows at `times`, the prediction's own times being `scale` times as long."""
    at, columns, end = [], [], None
    for j, name in enumerate(found.names):
        parts = _FRONT.fullmatch(name)
        if parts is None:
            continue
        if parts["at"] == "end":
            end = j
        else:
            at.append(float(parts["at"]))
            columns.append(j)
    table = 1e3 * np.stack([found.middle, found.low, found.high])
    rows: list[tuple[object, ...]] = []
    for t in times.tolist():
        values = [
            float(np.interp(t * scale, at, row[columns], left=np.nan, right=np.nan))
            for row in table
        ]
        if np.isfinite(values).all():
            rows.append((model, test.code, t, *values))
    if end is not None and np.isfinite(table[:, end]).all():
        rows.append((model, test.code, "end", *table[:, end].tolist()))
    return rows
