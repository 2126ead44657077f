"""What pours of a run were made for: later rounds are poured where one observation leads them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import ListOf, Number, Table, Text

__all__ = ["SCHEMA", "MadeFor"]

Array = NDArray[np.float64]

SCHEMA = Table({"recordings": ListOf(Text(), least=1), "x": ListOf(ListOf(Number()), least=1)})
# Another machine rounds otherwise; no two pours agree to so many digits of all statistics.
_RELATIVE, _ABSOLUTE = 1e-6, 1e-9


@dataclass(frozen=True)
class MadeFor:
    """Recordings of one material, known by what they show and not by their names.

    Attributes:
        recordings: their paths, as they were given.
        x: their statistics, own units, shape (k, s).
    """

    recordings: tuple[str, ...]
    x: Array

    @classmethod
    def of(cls, recordings: Sequence[str | Path], x: Array) -> "MadeFor":
        """Returns what is made for `recordings` of statistics `x` (k, s)."""
        return cls(tuple(str(path) for path in recordings), x)

    def as_dict(self) -> dict[str, Any]:
        """Returns plain values, for JSON."""
        return {"recordings": list(self.recordings), "x": self.x.tolist()}

    def require_same(self, stated: dict[str, Any], path: Path) -> None:
        """Refuses the pours in the file `path` if it states another observation.

        The order of recordings does not matter.

        Args:
            stated: what `as_dict` of it gave.
            path: the file.

        Raises:
            ValueError: names the recordings that the pours were made for.
        """
        rows = stated["x"]
        if len(rows) == len(self.x) and all(len(row) == self.x.shape[1] for row in rows):
            found, own = (_in_order(np.array(each, float)) for each in (rows, self.x))
            if np.allclose(found, own, rtol=_RELATIVE, atol=_ABSOLUTE):
                return
        there = ", ".join(stated["recordings"])
        what = f"another recording, {there}"
        if set(stated["recordings"]) == set(self.recordings):
            what = f"what {there} showed before it, or how it is read, was changed"
        raise ValueError(
            f"{path} has pours that were made for {what}: they and the posterior of it would be "
            "replaced; give another folder, or remove this one"
        )


def _in_order(x: Array) -> Array:
    """The rows in an order of their own."""
    return x[np.lexsort(x.T[::-1])]
