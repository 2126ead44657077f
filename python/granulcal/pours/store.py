"""Pours that are kept in a folder and never made twice: arrays by name, a group of pours a file.

A file is whole or absent. One that is damaged is as good as absent: its pours can be made again.
"""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import read_arrays
from granulcal.files import beside
from granulcal.pours.at_once import at_once
from granulcal.progress import steps

__all__ = ["PourStore"]

Array = NDArray[np.float64]
Of = TypeVar("Of")
Row = TypeVar("Row")


class PourStore:
    """A folder of kept pours.

    Args:
        folder: made with the first group that is kept.
        threads: pours at once.
    """

    def __init__(self, folder: Path, threads: int = 1) -> None:
        """Touches nothing."""
        self.folder, self.threads = folder, threads

    def read(self, name: str) -> dict[str, Array] | None:
        """Returns the arrays of a group; None where there is none, or a damaged one."""
        path = self._path(name)
        if not path.exists():
            return None
        try:
            return read_arrays(path)
        except (ValueError, OSError):
            return None

    def keep(self, name: str, arrays: dict[str, Array]) -> None:
        """Writes a group, in place of one that is damaged or of fewer arrays."""
        self.folder.mkdir(parents=True, exist_ok=True)
        with beside(self._path(name)) as temporary:
            np.savez_compressed(temporary, **arrays)  # pyright: ignore[reportArgumentType]

    def make(self, pour: Callable[[Of], Row], of: Iterable[Of]) -> list[Row]:
        """Returns `pour` of each, several at once, in their order.

        On a cluster, if the job has one: `pour` has to be one that can be pickled.
        """
        each = list(of)
        rows = at_once(pour, each, self.threads)
        # One pour is a step of whoever asks for it.
        counted = steps("pours", each) if len(each) > 1 else each
        made = dict(next(rows) for _ in counted)
        return [made[place] for place in range(len(each))]

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}.npz"
