"""How far two formations are from each other, in standard deviations of the training data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.arrays import unmasked
from granulcal.pours.dataset import Dataset
from granulcal.pours.statistics import NAMES, UNITS

__all__ = ["Scale", "StatisticRow", "comparison_table", "nearest_row", "standardised_distance"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scale:
    """Standard deviation of each statistic over the usable pours of a data set.

    Attributes:
        sd: standard deviations, SI units, shape (s,).
    """

    sd: Array

    @classmethod
    def of(cls, data: Dataset) -> "Scale":
        """Returns the scale of a data set.

        Raises:
            ValueError: fewer than two usable pours.
        """
        usable = data.x[data.is_usable]
        if len(usable) < 2:
            raise ValueError(f"a scale needs at least 2 usable pours, got {len(usable)}")
        return cls(usable.std(axis=0, ddof=1))

    def difference(self, a: ArrayLike, b: ArrayLike) -> Array:
        """Returns (a - b) in standard deviations, shape as `a - b`.

        A statistic that never varied in the data set cannot be scaled and counts as 0 where `a`
        and `b` are equal, else as infinite.
        """
        raw = np.asarray(unmasked("a", a), float) - np.asarray(unmasked("b", b), float)
        with np.errstate(divide="ignore", invalid="ignore"):
            scaled = raw / self.sd
        return np.where(raw == 0, 0.0, scaled)


def standardised_distance(a: ArrayLike, b: ArrayLike, scale: Scale) -> float:
    """Returns the L2 norm of the difference of two vectors of statistics in standard deviations."""
    return float(np.linalg.norm(scale.difference(a, b)))


def nearest_row(observed: ArrayLike, data: Dataset) -> int:
    """Returns the index of the usable pour of `data` that is nearest to `observed` (s,)."""
    usable = np.flatnonzero(data.is_usable)
    scaled = Scale.of(data).difference(data.x[usable], unmasked("observed", observed))
    # By a statistic that never varied all are as far.
    told = scaled[:, np.isfinite(scaled).all(axis=0)]
    return int(usable[np.linalg.norm(told, axis=1).argmin()])


@dataclass(frozen=True, kw_only=True)
class StatisticRow:
    """One statistic, measured and simulated.

    Attributes:
        name: its name.
        unit: its unit, `-` without one.
        measured: the measured value, SI.
        simulated: mean over the simulated pours, SI.
        sd: standard deviation over the simulated pours, SI; NaN for one pour.
        difference: simulated minus measured, in standard deviations of the training data.
    """

    name: str
    unit: str
    measured: float
    simulated: float
    sd: float
    difference: float

    @property
    def is_far(self) -> bool:
        """Whether the difference is beyond two standard deviations of the training data."""
        return abs(self.difference) > 2


def comparison_table(
    measured: ArrayLike,
    simulated: Sequence[ArrayLike],
    scale: Scale,
    units: Mapping[str, str] | None = None,
) -> list[StatisticRow]:
    """Returns one row for each statistic.

    Args:
        measured: measured statistics, shape (s,).
        simulated: statistics of each simulated pour, each of shape (s,), at least one.
        scale: standard deviations of the training data.
        units: unit of each statistic by its name, in order; the paper's 16 if None.
    """
    units = {name: UNITS[name] for name in NAMES} if units is None else units
    pours = np.array([np.asarray(pour, dtype=float) for pour in simulated])
    mean = pours.mean(axis=0)
    sd = pours.std(axis=0, ddof=1) if len(pours) > 1 else np.full(len(units), np.nan)
    vector = np.asarray(unmasked("measured", measured), dtype=float)
    differences = scale.difference(mean, vector)
    return [
        StatisticRow(
            name=name,
            unit=unit,
            measured=float(vector[i]),
            simulated=float(mean[i]),
            sd=float(sd[i]),
            difference=float(differences[i]),
        )
        for i, (name, unit) in enumerate(units.items())
    ]
