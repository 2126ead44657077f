"""Arrays from outside: in files, read with a bound and without pickles, and as arguments.

Errors name the file or the argument.
"""

import io
from pathlib import Path
from typing import Any
from zipfile import BadZipFile
from zlib import error as zlib_error

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import read_bytes

__all__ = ["read_array", "read_arrays", "read_only", "unmasked"]


def read_array(path: Path) -> NDArray[np.float64]:
    """Returns the array of numbers in a .npy file.

    Raises:
        ValueError: it is a device, too large, damaged, or holds something else; names the file.
        OSError: it cannot be read.
    """
    try:
        found = np.lib.format.read_array(io.BytesIO(read_bytes(path)), allow_pickle=False)
        return np.asarray(found, float)
    except (ValueError, TypeError, EOFError, MemoryError) as error:
        raise ValueError(f"{path}: no array of numbers: {error}") from None


def read_arrays(path: Path, *names: str) -> dict[str, NDArray[Any]]:
    """Returns the arrays of an .npz file by name, among them `names`.

    Raises:
        ValueError: it is a device, too large, damaged, or lacks one of the names; names the file.
        OSError: it cannot be read.
    """
    try:
        # In memory: a reader that stumbles leaves a file open.
        with np.load(io.BytesIO(read_bytes(path)), allow_pickle=False) as file:
            found = {key: file[key] for key in file.files}
    except (
        ValueError, TypeError, KeyError, EOFError, AttributeError, MemoryError, NotImplementedError,
        BadZipFile, zlib_error,
    ) as error:  # fmt: skip
        raise ValueError(f"{path}: no archive of arrays: {error}") from None
    if missing := [name for name in names if name not in found]:
        raise ValueError(f"{path} must have the arrays {', '.join(names)}; it lacks {missing}")
    return found


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Returns the array, into which nobody writes any more: it belongs to what handed it out."""
    array.setflags(write=False)
    return array


def unmasked(name: str, value: Any) -> NDArray[Any]:
    """Returns `value` as an array; NumPy alone would take what a mask hides for data.

    Raises:
        ValueError: entries are masked.
    """
    parts = value if isinstance(value, list | tuple) else (value,)
    if np.ma.is_masked(value) or any(np.ma.is_masked(part) for part in parts):
        hidden = sum(np.ma.count_masked(part) for part in parts)
        raise ValueError(
            f"{name} must have no masked entries, got {hidden}: fill them, as with "
            f"{name}.filled(...), or drop their rows"
        )
    return np.asarray(value)
