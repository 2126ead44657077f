"""Statistics that were measured by whatever means, each with its name and its value."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from granulcal.documents import Mapping, Maybe, Number, Table, meant, read_json
from granulcal.measured.table import number_in, rows_of
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import ObservedStatistics

__all__ = ["NamedValues", "is_of_named_values"]

_HEADER = ["statistic", "value"]
# What `simulate --json` prints; there is null where a statistic has no value.
_DOCUMENT = Table({"observed": Mapping(Maybe(Number()))}, open=True)
_JSON = ".json"


def is_of_named_values(path: str | PathLike[str]) -> bool:
    """Returns whether a file is JSON, or a table with the columns statistic and value."""
    if Path(path).suffix.lower() == _JSON:
        return True
    try:
        return _words(next(rows_of(path), [])) == _HEADER
    except ValueError:
        # No table at all, which whoever reads it says.
        return False


@dataclass(frozen=True, kw_only=True)
class NamedValues:
    """Values by the names of a scene's statistics.

    Attributes:
        path: the file, for messages.
        values: each value in the unit of its statistic, by name; NaN where it has none.
    """

    path: Path
    values: dict[str, float]

    @classmethod
    def open(cls, path: str | PathLike[str]) -> "NamedValues":
        """Returns the values of a .csv or .json file.

        Raises:
            FileNotFoundError: there is no such file.
            ValueError: other columns, a line that is no name and a finite number, a name that
                stands there twice, or JSON without `observed`.
        """
        where = Path(path)
        if where.suffix.lower() == _JSON:
            found = read_json(where, _DOCUMENT)["observed"]
            nothing = float("nan")
            return cls(
                path=where,
                values={n: nothing if v is None else float(v) for n, v in found.items()},
            )
        values: dict[str, float] = {}
        rows = rows_of(where)
        if (header := _words(next(rows, []))) != _HEADER:
            raise ValueError(f"{path}: the columns must be {_HEADER}, got {header}")
        for number, row in enumerate(map(_words, rows), start=2):
            if not row:
                continue
            name, value = _statistic(row, f"{path}: line {number}")
            if name in values:
                raise ValueError(f"{path}: line {number}: {name} stands there twice")
            values[name] = value
        return cls(path=where, values=values)

    def observed(self, scene: Scene) -> ObservedStatistics:
        """Returns the statistics that `scene` observes; NaN where the file has none.

        Raises:
            ValueError: the file has none of them, or one that the scene does not observe.
        """
        names = scene.observed_names
        for name in self.values:
            if name not in names:
                listed = ", ".join(names) or "nothing"
                raise ValueError(
                    f"{self.path}: {name!r} is no statistic of the scene{meant(name, names)}; "
                    f"it observes {listed}"
                )
        if not self.values:
            raise ValueError(f"{self.path} has no statistic")
        return ObservedStatistics(
            np.array([self.values.get(name, float("nan")) for name in names]), names
        )


def _words(row: list[str]) -> list[str]:
    """The cells without the blanks about them."""
    return [cell.strip() for cell in row]


def _statistic(row: list[str], where: str) -> tuple[str, float]:
    try:
        name, text = row
        value = number_in(text)
    except ValueError:
        raise ValueError(f"{where} must be a name and a number, got {row}") from None
    if not np.isfinite(value):
        raise ValueError(f"{where} must be a finite number, got {row}")
    return name, value
