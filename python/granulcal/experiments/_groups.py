"""The loop on groups of maps that share one archive: closing them, and what their verdicts say."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from granulcal.loop.close import Closed, close_loop
from granulcal.loop.report.folder import write_report
from granulcal.loop.task import Task

__all__ = ["close_groups", "verdict_lines"]

# Models that a table shows.
_SHOWN = 6


def close_groups(
    folder: Path, asked: Mapping[str, Task], *, budget: int, command: str, title: str
) -> dict[str, Closed]:
    """Closes the loop on every group; reports in `folder`/GROUP, pours in `folder`/archive.

    Args:
        folder: of the study.
        asked: tasks by group, all of the same archive.
        budget: pours of each, those of the archive among them.
        command: that makes the reports.
        title: of a report, before its group.
    """
    closed: dict[str, Closed] = {}
    surrogate = None
    for group, task in asked.items():
        closed[group] = close_loop(
            task,
            folder / group,
            archive=folder / "archive",
            budget=budget,
            pairs=0,
            surrogate=surrogate,
        )
        # Every group has the same pours.
        surrogate = closed[group].trace.local.surrogate
        write_report(closed[group], folder / group, command=command, title=f"{title}: {group}")
    return closed


def verdict_lines(group: str, closed: Closed) -> list[str]:
    """Returns the verdict of a group and its most probable models, as Markdown."""
    verdict = closed.verdict
    said = " ".join([verdict.kind, ", ".join(verdict.named)]).strip()
    lines = [f"## {group}", "", f"{said}: {verdict.reason}", ""]
    lines += ["| model | log probability over none [nat] | p of what it leaves |", "|---|---|---|"]
    for one in closed.trace.explanations[:_SHOWN]:
        left = "not tested" if np.isnan(one.p_after) else f"{one.p_after:.3g}"
        lines.append(f"| {' + '.join(one.effects)} | {one.log_probability:.1f} | {left} |")
    return [*lines, "", *(f"- {text}" for text in closed.trace.beyond), ""]
