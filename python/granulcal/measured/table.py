"""Rows of a table that somebody else wrote: CSV of UTF-8, with or without a spreadsheet's mark."""

import csv
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

from granulcal.documents import ENCODING

__all__ = ["number_in", "rows_of"]


def rows_of(path: str | PathLike[str]) -> Iterator[list[str]]:
    """Yields the rows of a CSV file; other letters than UTF-8's are replaced.

    Raises:
        OSError: it cannot be read.
        ValueError: it is no table; names the file.
    """
    with Path(path).open(newline="", encoding=ENCODING, errors="replace") as file:
        try:
            yield from csv.reader(file)
        except csv.Error as error:
            raise ValueError(f"{path} is no table: {error}") from None


def number_in(text: str) -> float:
    """Returns the number that a cell holds.

    Raises:
        ValueError: it holds none; `23_5`, a literal of Python, is none either.
    """
    if "_" in text:
        raise ValueError(f"no number: {text!r}")
    return float(text)
