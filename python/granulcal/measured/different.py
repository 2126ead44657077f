"""Recordings of one material are of different pours."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["first_copy", "require_different"]

Array = NDArray[np.float64]


def first_copy(rows: Sequence[Array]) -> tuple[int, int] | None:
    """Returns the first two rows that are the same to the last digit, the later one second."""
    for second, row in enumerate(rows):
        for first in range(second):
            if np.array_equal(row, rows[first]):
                return first, second
    return None


def require_different(observed: Array) -> None:
    """Refuses a recording that is given twice: it would count as two pours.

    Copies are found as well, for no two pours agree to the last digit of all statistics.

    Args:
        observed: statistics of each recording, shape (k, s).

    Raises:
        ValueError: two rows are the same.
    """
    if (copy := first_copy(list(observed))) is not None:
        first, second = copy
        raise ValueError(
            f"recordings {first + 1} and {second + 1} show one formation, to the last "
            "digit of all statistics: each pour counts once"
        )
