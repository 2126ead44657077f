"""The loop's report in a folder: the page, and the tables beside it."""

from collections.abc import Callable
from pathlib import Path

from granulcal.loop.closed import Closed
from granulcal.loop.report.page import write_page
from granulcal.loop.report.tables import write_tables

__all__ = ["write_report"]


def write_report(
    closed: Closed,
    folder: Path,
    *,
    command: str,
    title: str,
    say: Callable[[str], None] = print,
) -> None:
    """Writes `report.html` and the Parquet tables.

    The page is left out, and that is said, where jinja2 or matplotlib is not installed, and the
    tables where pyarrow is not: the verdict is written by then, and stands without them.
    """
    page = folder / "report.html"
    try:
        write_page(closed, page, command=command, title=title)
        say(str(page))
    except ModuleNotFoundError as error:
        say(f"report.html left out: {error}")
    try:
        write_tables(closed, folder)
    except ModuleNotFoundError as error:
        say(f"tables left out: {error}")
