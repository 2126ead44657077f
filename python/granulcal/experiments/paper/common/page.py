"""One self-contained HTML page of the experiments that have run, and their tables as Markdown."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from granulcal import _native
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.outcome import Outcome, Table
from granulcal.experiments.paper.common.sizes import Size
from granulcal.files import write_beside
from granulcal.report import data_uri, template

__all__ = ["write_page", "write_tables"]

_TEMPLATE = "paper.html.j2"
_PAPER = (
    "C. Matl, Y. Narang, R. Bajcsy, F. Ramos, D. Fox: Inferring the Material Properties of "
    "Granular Media for Robotic Tasks, ICRA 2020, arXiv:2003.08032"
)


def write_page(folder: Path, known: list[Experiment], size: Size) -> Path:
    """Writes report.html into `folder`; returns its path. It needs no other file and no network.

    Args:
        folder: of the results of this size.
        known: every experiment; those that have not run are named as such.
        size: of the run.
    """
    parts: list[dict[str, Any]] = []
    for experiment in known:
        loaded = Outcome.load(folder / experiment.name)
        part: dict[str, Any] = {"experiment": experiment, "outcome": None}
        if loaded is not None:
            outcome, made = loaded
            pictures = [
                (data_uri((folder / experiment.name / f.file).read_bytes()), f.caption)
                for f in outcome.figures
            ]
            part |= {"outcome": outcome, "made": made, "pictures": pictures}
        parts.append(part)
    page = template(_TEMPLATE).render(
        parts=parts,
        size=size,
        paper=_PAPER,
        version=_native.__version__,
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        judged=_count(parts),
    )
    path = folder / "report.html"
    write_beside(path, page)
    return path


def write_tables(folder: Path, known: list[Experiment]) -> Path:
    """Writes results.md into `folder`, the rows and tables of what has run; returns its path.

    Args:
        folder: of the results of a size.
        known: every experiment; those that have not run are left out.
    """
    parts = []
    for experiment in known:
        loaded = Outcome.load(folder / experiment.name)
        if loaded is None:
            continue
        outcome, made = loaded
        rows = Table(
            title="",
            columns=["quantity", "paper", "ours", "judged, with its 95 % interval", "n", ""],
            rows=[
                [r.quantity, r.paper, r.ours, r.interval, str(r.count), r.verdict]
                for r in outcome.rows
            ],
        )
        tables = [f"{table.title}:\n\n{_markdown(table)}" for table in outcome.tables]
        left = [f"Not run yet: {'; '.join(outcome.missing)}."] if outcome.missing else []
        how = f"    {made['command']}    # {made['pours']} pours, {made['at']}"
        title = f"## {experiment.number} {experiment.title}"
        notes = [f"- {note}" for note in outcome.notes]
        parts += [title, outcome.answer, *left, how, _markdown(rows), *tables, "\n".join(notes)]
    path = folder / "results.md"
    write_beside(path, "\n\n".join(part for part in parts if part) + "\n")
    return path


def _markdown(table: Table) -> str:
    lines = [table.columns, ["---"] * len(table.columns), *table.rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)


def _count(parts: list[dict[str, Any]]) -> dict[str, int]:
    """How many rows have which verdict."""
    counts = {"better": 0, "not decided": 0, "worse": 0}
    for part in parts:
        for row in part["outcome"].rows if part["outcome"] else []:
            # "not decided" may say why after a colon.
            verdict = row.verdict.partition(":")[0]
            if verdict in counts:
                counts[verdict] += 1
    return counts
