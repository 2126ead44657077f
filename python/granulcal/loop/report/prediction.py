"""Statistics under a condition that was not measured, with the interval of one pour."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.report.interval import fewest_of_ranks, of_one_more

__all__ = ["FEWEST", "Prediction", "require_level"]

Array = NDArray[np.float64]

FEWEST = 2
"""Usable pours that a prediction needs."""


def require_level(level: float) -> None:
    """Raises ObservationError unless `level` is a share of pours that an interval may hold."""
    if not 0 < level < 1:
        raise ObservationError(f"level must be between 0 and 1, got {level}")


@dataclass(frozen=True)
class Prediction:
    """Statistics under a condition.

    Attributes:
        model: one of `MODELS`, or `posterior`.
        names: of the statistics, s of them.
        middle: mean, shape (s,).
        low, high: ends of the interval, shape (s,).
        level: of the interval.
        pours: usable ones that it is of; None of a model that pours nothing.
        doubts: what is to be said of it, a sentence each.
    """

    model: str
    names: tuple[str, ...]
    middle: Array
    low: Array
    high: Array
    level: float
    pours: int | None = None
    doubts: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON: null where a statistic has no number."""

        def number(value: float) -> float | None:
            return float(value) if np.isfinite(value) else None

        return {
            "model": self.model,
            "level": self.level,
            "pours": self.pours,
            "warnings": list(self.doubts),
            "statistics": {
                name: {"middle": number(m), "low": number(a), "high": number(b)}
                for name, m, a, b in zip(self.names, self.middle, self.low, self.high, strict=True)
            },
        }

    @classmethod
    def of_pours(
        cls,
        model: str,
        names: tuple[str, ...],
        rows: Array,
        level: float,
        pours: int | None = None,
        asked: int | None = None,
    ) -> "Prediction":
        """Returns the mean of usable pours and the interval of one further pour.

        Args:
            model: what they are of.
            names: of the statistics, s of them.
            rows: statistics, as many of each pour, shape (n, s).
            level: of the interval.
            pours: that the rows are of; each of one by default.
            asked: pours that were made; those beyond `pours` could not be used, which is told.

        Raises:
            ObservationError: fewer than `FEWEST` pours.
        """
        pours = len(rows) if pours is None else pours
        if pours < FEWEST:
            raise ObservationError(
                f"{model}: {pours} usable pours under this condition, at least {FEWEST} are "
                "needed: grains jam, leave the view or are unhealthy"
            )
        low, high = of_one_more(rows, level, pours)
        doubts: list[str] = []
        least = fewest_of_ranks(level)
        if asked is not None and pours < asked:
            doubts.append(
                f"{asked - pours} of {asked} pours under this condition jam, leave the view or are "
                "unhealthy: middle and interval are of the others alone"
            )
        if pours < least:
            doubts.append(
                f"{pours} usable pours are too few for ranks at {100 * level:g} %, {least} are "
                "needed: the intervals are Student's t's of normal statistics, which may reach "
                "beyond what a statistic can be"
            )
        return cls(model, names, rows.mean(axis=0), low, high, level, pours, tuple(doubts))
