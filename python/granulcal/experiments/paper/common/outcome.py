"""What an experiment found: rows beside the paper's numbers, tables, figures, how it was made."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from granulcal.files import write_beside

__all__ = ["Figure", "Outcome", "Row", "Table"]

_RESULT = "result.json"


@dataclass(frozen=True, kw_only=True)
class Row:
    """One number of ours, beside the paper's where it has one.

    Attributes:
        quantity: what it is, with its unit.
        paper: the paper's number as it prints it; empty where it has none.
        ours: ours, printed the same way.
        interval: what is judged, with its 95 % interval; empty where nothing is.
        count: tests behind it.
        verdict: `better`, `worse`, `not decided`, or empty where nothing is judged.
    """

    quantity: str
    paper: str = ""
    ours: str
    interval: str = ""
    count: int
    verdict: str = ""


@dataclass(frozen=True, kw_only=True)
class Table:
    """A further table.

    Attributes:
        title: above it.
        columns: heads.
        rows: cells, as printed.
    """

    title: str
    columns: list[str]
    rows: list[list[str]]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A picture in the folder of the experiment.

    Attributes:
        file: its name there, a PNG.
        caption: what it shows.
    """

    file: str
    caption: str


@dataclass(kw_only=True)
class Outcome:
    """Everything that an experiment reports.

    Attributes:
        rows: the paper's numbers and ours.
        answer: one or two sentences.
        tables: further tables.
        figures: pictures.
        notes: what a reader has to know.
        missing: parts of the experiment that have not been run yet.
    """

    rows: list[Row]
    answer: str
    tables: list[Table] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)

    @classmethod
    def load(cls, folder: Path) -> "tuple[Outcome, dict[str, Any]] | None":
        """Returns what `save` wrote to `folder` and how it was made; None if it has not run."""
        path = folder / _RESULT
        if not path.exists():
            return None
        try:
            document = json.loads(path.read_text(encoding="utf-8"))
            made = document.pop("made")
            outcome = cls(
                rows=[Row(**row) for row in document.pop("rows")],
                tables=[Table(**table) for table in document.pop("tables")],
                figures=[Figure(**figure) for figure in document.pop("figures")],
                **document,
            )
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"{path} is damaged or of another version: {error}") from None
        return outcome, made

    @classmethod
    def is_complete(cls, folder: Path) -> bool:
        """Returns whether the experiment has run, with all its parts."""
        loaded = cls.load(folder)
        return loaded is not None and not loaded[0].missing

    def save(self, folder: Path, made: dict[str, Any]) -> None:
        """Writes result.json to `folder`.

        Args:
            folder: of the experiment.
            made: command, size, seeds, pours, times and version, by name.
        """
        text = json.dumps({**asdict(self), "made": made}, indent=1)
        write_beside(folder / _RESULT, text + "\n")
