"""Recordings of one material are of different pours."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["require_different"]


def require_different(observed: NDArray[np.float64]) -> None:
    """Refuses a recording that is given twice: it would count as two pours.

    Copies are found as well, for no two pours agree to the last digit of all statistics.

    Args:
        observed: statistics of each recording, shape (k, s).

    Raises:
        ValueError: two rows are the same.
    """
    for second, row in enumerate(observed):
        for first in range(second):
            if np.array_equal(row, observed[first]):
                raise ValueError(
                    f"recordings {first + 1} and {second + 1} show one formation, to the last "
                    "digit of all statistics: each pour counts once"
                )
