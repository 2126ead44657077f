"""The one place where arrays from outside become float64 matrices of a known shape."""

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import unmasked

__all__ = ["as_matrix", "as_real", "known"]


def as_real(name: str, value: Any) -> NDArray[np.float64]:
    """Returns `value` as a float64 array; booleans, text, objects and complex are refused.

    Raises:
        TypeError: `value` is not an array of real numbers.
        ValueError: it has a mask that hides some of them.
    """
    if np.ma.isMaskedArray(value):
        value = unmasked(name, value)
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise TypeError(f"{name} must be an array of real numbers: {error}") from None
    if array.dtype.kind not in "fiu":
        raise TypeError(f"{name} must be an array of real numbers, got {_shown(value, array)}")
    return array.astype(np.float64)


def _shown(value: Any, array: NDArray[Any]) -> str:
    """What was given: an array's dtype, else its type, and what of it would do."""
    if isinstance(value, np.ndarray | list | tuple):
        return f"dtype {array.dtype}"
    if isinstance(value, str | os.PathLike):
        return f"the path or word {str(value)!r}: open it first, as with Recording.open"
    helps = ": give its statistics()" if hasattr(value, "statistics") else ""
    return f"{type(value).__name__}{helps}"


def as_matrix(name: str, value: Any, *, columns: int | None = None) -> NDArray[np.float64]:
    """Returns `value` as a matrix, shape (rows, columns); one row may come as a vector.

    Raises:
        TypeError: `value` is not an array of real numbers.
        ValueError: `value` has another number of dimensions or columns.
    """
    array = as_real(name, value)
    expected = f"(rows, {'columns' if columns is None else columns})"
    if array.ndim == 1 and columns is not None:
        array = array[None, :]
    if array.ndim != 2 or (columns is not None and array.shape[1] != columns):
        found = np.shape(value)
        raise ValueError(f"{name} must have shape {expected}, got {found}")
    return array


def known(theta: NDArray[np.float64], names: Sequence[str]) -> NDArray[np.float64]:
    """Returns `theta` (n, p), whose columns are `names`, if none is NaN: it lies nowhere.

    Raises:
        ValueError: names the first that is.
    """
    rows, columns = np.nonzero(np.isnan(theta))
    if len(rows):
        raise ValueError(f"theta: {names[columns[0]]} is NaN in row {rows[0]}; give a number")
    return theta
