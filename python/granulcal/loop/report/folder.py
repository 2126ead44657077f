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
) -> Path:
    """Writes `report.html` and the Parquet tables; returns the page.

    The tables are left out, and that is said, where pyarrow is not installed.
    """
    page = folder / "report.html"
    write_page(closed, page, command=command, title=title)
    try:
        write_tables(closed, folder)
    except ModuleNotFoundError as error:
        say(f"tables left out: {error}")
    say(str(page))
    return page
