"""Measured pours of one material, one group for each condition."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import ObservationError

__all__ = ["ConditionPours", "session_numbers"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ConditionPours:
    """Pours of one material under one condition.

    Attributes:
        label: what tables call the condition.
        condition: unit coordinates, shape (q,).
        pours: statistics in the archive's units and columns, shape (n, s).
        session: of the recordings; empty for one of its own.
    """

    label: str
    condition: Array
    pours: Array
    session: str = ""

    @classmethod
    def of(
        cls, label: str, condition: ArrayLike, pours: ArrayLike, session: str = ""
    ) -> "ConditionPours":
        """Returns the observation as arrays.

        Raises:
            ObservationError: no pours.
        """
        rows = np.asarray(pours, dtype=np.float64)
        if rows.ndim != 2 or len(rows) == 0:
            raise ObservationError(f"{label}: pours must have shape (n > 0, s), got {rows.shape}")
        return cls(label, np.atleast_1d(np.asarray(condition, dtype=np.float64)), rows, session)


def session_numbers(sessions: Sequence[str]) -> NDArray[np.int64]:
    """Returns a number for each session, the same where they are: an empty one is its own."""
    known = {name: i for i, name in reversed(list(enumerate(sessions))) if name}
    return np.array([known.get(name, i) for i, name in enumerate(sessions)], dtype=np.int64)
