"""Discharge curves: percent that has run out against time, as CSV."""

from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.measured.names import observed_of, value_at
from granulcal.measured.table import number_in, rows_of
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import ObservedStatistics

__all__ = ["DischargeCurve"]

Array = NDArray[np.float64]

_HEADER = ["series", "time_s", "discharged_percent"]
# Letters of another header that a message shows.
_SHOWN = 60
# Percent by which a weighed share may be off: what swings on a balance falls and overshoots.
_MARGIN = 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class DischargeCurve:
    """One series of a file with the columns series, time_s, discharged_percent.

    Attributes:
        series: its name.
        time: since the flow began [s], shape (n,).
        percent: share that has run out [%], shape (n,).
    """

    series: str
    time: Array
    percent: Array

    @classmethod
    def open(cls, path: str | PathLike[str], series: str | None = None) -> "DischargeCurve":
        """Returns the series of that name, or the only one.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: other columns, a line that is no finite numbers or no percentage, no such
                series, or one that falls or hardly begins; the message says what there is.
        """
        points: dict[str, list[tuple[float, float, int]]] = {}
        rows = rows_of(path)
        header = [name.strip() for name in next(rows, [])]
        if header != _HEADER:
            found = ",".join(header)
            found = found if len(found) <= _SHOWN else f"{found[:_SHOWN]}..."
            raise ValueError(
                f"{path}: the columns must be {','.join(_HEADER)} of a discharge curve, or "
                f"statistic,value of a table, got {found!r}"
            )
        for number, row in enumerate(rows, start=2):
            if not row:
                continue
            try:
                name, time, percent = row
                point = number_in(time), number_in(percent), number
            except ValueError:
                message = f"{path}: line {number} must be a name and two numbers, got {row}"
                raise ValueError(message) from None
            if not (np.isfinite(point[0]) and -_MARGIN <= point[1] <= 100.0 + _MARGIN):
                raise ValueError(
                    f"{path}: line {number} must be a finite time and a share from 0 to 100 %, "
                    f"got {row}"
                )
            points.setdefault(name, []).append(point)
        if series is None and len(points) == 1:
            series = next(iter(points))
        if series is None or series not in points:
            raise ValueError(f"{path}: series must be one of {sorted(points)}, got {series!r}")
        time, percent, lines = np.array(sorted(points[series])).T
        _require_rising(path, series, percent, lines)
        return cls(series=series, time=time, percent=percent)

    def rate(self) -> float:
        """Returns the least-squares slope between 5 and 85 % [%/s], below 95 % of what runs out.

        What stays behind, on a flat bottom or above an arch, is in no point of the flow. The same
        function as of the simulated `discharge_rate`.
        """
        time, percent = (np.ascontiguousarray(each, float) for each in (self.time, self.percent))
        return _native.discharge_rate(time, percent)

    def observed(self, scene: Scene) -> ObservedStatistics:
        """Returns the measured `discharged[t]` of the scene's times and the `discharge_rate`.

        Raises:
            ValueError: the scene observes no discharge.
        """

        def discharged(at: str | None) -> float:
            return value_at(self.time, self.percent, float(at or "nan"))

        kinds = {"discharged": discharged, "discharge_rate": lambda _: self.rate()}
        return observed_of(scene, kinds, "a discharge curve")


def _require_rising(path: str | PathLike[str], series: str, percent: Array, lines: Array) -> None:
    """Refuses a curve that falls, and one that ends before the rate can be read."""
    fallen = np.maximum.accumulate(percent) - percent
    if fallen.max() > _MARGIN:
        at = int(np.argmax(fallen > _MARGIN))
        raise ValueError(
            f"{path}: line {lines[at]:.0f}: what has run out cannot fall, series {series!r} does "
            f"by {fallen[at]:.3g} % to {percent[at]:.4g} %: is it the share that is left?"
        )
    if not percent.max() > _native.DISCHARGE_RANGE[0]:
        raise ValueError(
            f"{path}: series {series!r} ends at {percent.max():.3g} %, must pass "
            f"{_native.DISCHARGE_RANGE[0]:g} %: is it in percent?"
        )
