"""Tests of collapsing columns: what was stated of each, and the fronts of those that are given.

A test states gravity, beads and fluid. Fronts are taken at times in units of 1 / sqrt(N), the free
fall of the test's gravity, so that those of all gravities stand in one table.
"""

import re
from dataclasses import dataclass
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.measured.run_out import RunOut
from granulcal.pours.scene import Scene

__all__ = ["Fronts", "Test", "all_tests", "observing", "read_fronts", "read_tests", "times_of"]

Array = NDArray[np.float64]

_FOLDER = Path("column-collapse-webb")
_CONDITIONS = _FOLDER / "Experimental_Conditions.txt"
_FURTHER = Path("to-predict") / "columns.txt"
_BEADS = (8e-3, 6e-3)
# Times of the fronts [s] at one g, and their step.
_STEP, _LAST = 0.025, 0.4
# A front that leaves the view goes on as over its last times, for that long [s at one g].
_OVER, _BEYOND = 0.06, 0.1


@dataclass(frozen=True)
class Test:
    """One test of the table.

    Attributes:
        code: its name, which begins with its day.
        numbers: columns of the table by their names, SI units.
        fluid: `w` water, `g` with glycerol, `k` with clay.
    """

    __test__ = False

    code: str
    numbers: dict[str, float]
    fluid: str = "w"

    @property
    def campaign(self) -> str:
        """The day: tests of one day share the setting of the tube and of the cameras."""
        return self.code.partition("_")[0]

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


@dataclass(frozen=True)
class Fronts:
    """Measured fronts, a test each.

    Attributes:
        tests: n of them.
        radius: at `times_of` each test and at the end [mm], NaN where not seen, shape (n, T + 1).
    """

    tests: tuple[Test, ...]
    radius: Array

    def where(self, keep: NDArray[np.bool_]) -> "Fronts":
        """Returns the tests for which `keep` (n,) holds."""
        tests = tuple(test for test, kept in zip(self.tests, keep, strict=True) if kept)
        return Fronts(tests, self.radius[keep])


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
            found.append(Test(row["TestCode"], numbers, row["IF"]))
    return found


def all_tests(data: Path) -> list[Test]:
    """Returns the given tests, then those whose fronts are not given."""
    tests = read_tests(data / _CONDITIONS)
    further = data.parent / _FURTHER
    return tests + (read_tests(further) if further.exists() else [])


def observing(scene: Scene, times: Array, *, end: bool = True) -> Scene:
    """Returns the scene with its front taken at `times` [s], and at the end or not."""
    listed = ", ".join(repr(float(t)) for t in times)
    more = "" if end else "\nend = false"
    text, count = re.subn(
        r"(?ms)(^\[observe\.front\].*?^times = )\[[^\]]*\]",
        rf"\g<1>[{listed}]{more}",
        scene.to_toml(),
    )
    if count != 1:
        raise ObservationError("the scene observes no front")
    return Scene.from_toml(text)


def times_of(test: Test) -> Array:
    """Returns when the front is asked for, after the release [s]."""
    count = round(_LAST / _STEP)
    times = _STEP * np.arange(1, count + 1, dtype=np.float64) / sqrt(test.numbers["N"])
    return np.asarray(times, dtype=np.float64)


def read_fronts(data: Path) -> Fronts:
    """Returns the fronts of the tests with beads of 8 and 6 mm whose run-out files are there."""
    tests, rows = [], []
    for test in read_tests(data / _CONDITIONS):
        path = data / _FOLDER / "runout" / f"{test.code}.txt"
        if path.exists():
            tests.append(test)
            rows.append(_row(RunOut.open(path), test))
    count = round(_LAST / _STEP) + 1
    return Fronts(tuple(tests), 1e3 * np.array(rows).reshape(len(rows), count))


def _row(run_out: RunOut, test: Test) -> Array:
    radius, times = run_out.front_radius(), times_of(test)
    seen = np.isfinite(radius)
    if not seen.any():
        return np.full(len(times) + 1, np.nan)
    at, front = run_out.time[seen], radius[seen]
    found = np.interp(times, at, front, left=np.nan, right=np.nan)
    unit = 1 / sqrt(test.numbers["N"])
    last = at > at[-1] - _OVER * unit
    if last.sum() > 1:
        speed = np.polyfit(at[last], front[last], 1)[0]
        beyond = (times > at[-1]) & (times < at[-1] + _BEYOND * unit)
        found[beyond] = front[-1] + speed * (times[beyond] - at[-1])
    return np.append(found, run_out.end_radius())
