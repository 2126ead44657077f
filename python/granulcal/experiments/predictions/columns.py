"""Fronts of collapsing columns under every test with beads of 8 and 6 mm.

A test states gravity, beads and fluid. The base model takes the beads and the gravity; a named
effect of a fluid takes the fluid's own density and viscosity as well. The rows without physics know
times in units of 1 / sqrt(N), the free fall of the test's gravity, and nothing of the fluid.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.models import Models, Prediction
from granulcal.pours.scene import Scene

__all__ = ["Test", "column_rows", "observing", "read_tests", "times_of"]

Array = NDArray[np.float64]

_CONDITIONS = Path("column-collapse-webb") / "Experimental_Conditions.txt"
_FURTHER = Path("to-predict") / "columns.txt"
_BEADS = (8e-3, 6e-3)
_POURS = 8
# Times of the fronts [s] at one g, and their step.
_STEP, _LAST = 0.025, 0.4
_FLUID = {
    "effects.fluid.density": "rho_f",
    "effects.fluid.viscosity": "mu_f",
    "effects.lubrication.viscosity": "mu_f",
}
_FRONT = re.compile(r"front_radius\[(?P<at>[^\]]+)\]")


@dataclass(frozen=True)
class Test:
    """One test of the table.

    Attributes:
        code: its name.
        numbers: columns of the table by their names, SI units.
    """

    __test__ = False

    code: str
    numbers: dict[str, float]

    def scene_numbers(self, scene: Scene) -> dict[str, float]:
        """Returns gravity and beads of the test: as many as fill the scene's column."""
        diameter = self.numbers["d_p"]
        ratio = diameter / scene.get("grains.diameter")
        return {
            "gravity.2": -self.numbers["G"],
            "grains.diameter": diameter,
            "grains.count": float(round(scene.get("grains.count") / ratio**3)),
            "grains.density": self.numbers["rho_p"],
            "start.spacing": scene.get("start.spacing") * ratio,
            "start.jitter": scene.get("start.jitter") * ratio,
        }


def read_tests(path: Path) -> list[Test]:
    """Returns the tests with beads of 8 and 6 mm of a table of conditions.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: a row with another number of columns than the header.
    """
    header, *lines = [line.split() for line in path.read_text().splitlines() if line.strip()]
    found = []
    for number, words in enumerate(lines, start=2):
        if len(words) != len(header):
            raise ValueError(
                f"{path}: line {number} must have {len(header)} columns, got {len(words)}"
            )
        row = dict(zip(header, words, strict=True))
        numbers = {
            name: float(word) for name, word in row.items() if name not in ("TestCode", "IF")
        }
        if numbers["d_p"] in _BEADS:
            found.append(Test(row["TestCode"], numbers))
    return found


def times_of(test: Test) -> Array:
    """Returns when the front is asked for, after the release [s]."""
    count = round(_LAST / _STEP)
    times = _STEP * np.arange(1, count + 1, dtype=np.float64) / sqrt(test.numbers["N"])
    return np.asarray(times, dtype=np.float64)


def observing(scene: Scene, times: Array) -> Scene:
    """Returns the scene with its front taken at `times` [s]."""
    listed = ", ".join(repr(float(t)) for t in times)
    text, count = re.subn(
        r"(?ms)(^\[observe\.front\].*?^times = )\[[^\]]*\]",
        rf"\g<1>[{listed}]",
        scene.to_toml(),
    )
    if count != 1:
        raise ObservationError("the scene observes no front")
    return Scene.from_toml(text)


def column_rows(
    models: Models, pours: Path, data: Path, *, say: Callable[[str], None]
) -> list[tuple[object, ...]]:
    """Returns rows (model, test, time, radius, low, high) in s and mm; the end's time is `end`."""
    tests = read_tests(data / _CONDITIONS)
    if (data.parent / _FURTHER).exists():
        tests += read_tests(data.parent / _FURTHER)
    forward, rows = Forward(pours, 1), list[tuple[object, ...]]()
    for test in tests:
        rows += _simulated(models, test, forward, say)
        rows += _without_physics(models, test, forward, say)
    return rows


def _simulated(
    models: Models, test: Test, forward: Forward, say: Callable[[str], None]
) -> list[tuple[object, ...]]:
    scene = observing(models.scene, times_of(test))
    there = replace(models, scene=scene, names=tuple(scene.observed_names))
    found = []
    for model in ("named", "base"):
        at = test.scene_numbers(models.scene)
        own = models.makers[model][0].numbers
        at |= {path: test.numbers[column] for path, column in _FLUID.items() if path in own}
        try:
            prediction = there.predict(model, at, forward, pours=_POURS)
        except ValueError as error:
            say(f"columns, {model} of {test.code}: no prediction: {error}")
            continue
        found += _rows(model, test, prediction, times_of(test), 1.0)
    return found


def _without_physics(
    models: Models, test: Test, forward: Forward, say: Callable[[str], None]
) -> list[tuple[object, ...]]:
    """At the times of the fitted conditions, scaled; between them linear."""
    found = []
    for model in ("corrected", "line", "nearest"):
        try:
            prediction = models.predict(
                model, {"gravity.2": -test.numbers["G"]}, forward, pours=_POURS
            )
        except ValueError as error:
            say(f"columns, {model} of {test.code}: no prediction: {error}")
            continue
        found += _rows(model, test, prediction, times_of(test), sqrt(test.numbers["N"]))
    return found


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
