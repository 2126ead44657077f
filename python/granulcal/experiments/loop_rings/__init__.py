"""The loop on rings: a ball of sand dropped on a loose bed of sand, both of coarse grains."""

from pathlib import Path

from granulcal.experiments.loop_rings.picture import picture
from granulcal.experiments.loop_rings.seen import look, table
from granulcal.experiments.loop_rings.task import GROUPS, task
from granulcal.files import write_beside
from granulcal.loop.close import Closed, close_loop
from granulcal.loop.report.folder import write_report
from granulcal.pours.pour_time import PourKind

__all__ = ["GROUPS", "reproduce", "task"]

_BUDGET = 545


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data, next(iter(GROUPS)))
    return [PourKind("the archive", asked.at_first(), asked.prior, _BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop on every group of rings; results.md and pages in `out`/loop_rings.

    Returns whether every verdict stands.
    """
    folder = out / "loop_rings"
    closed: dict[str, Closed] = {}
    surrogate = None
    for group in GROUPS:
        closed[group] = close_loop(
            task(data, group),
            folder / group,
            archive=folder / "archive",
            budget=_BUDGET,
            pairs=0,
            surrogate=surrogate,
        )
        # Every group has the same pours.
        surrogate = closed[group].trace.local.surrogate
        write_report(
            closed[group],
            folder / group,
            command=f"granulcal reproduce loop_rings --out {out}",
            title=f"Rings on a loose bed: {group}",
        )
    seen = {group: look(one) for group, one in closed.items()}
    picture(folder / "rings.png", seen)
    lines = [
        line for group, one in closed.items() for line in (*_table(group, one), *table(seen[group]))
    ]
    write_beside(folder / "results.md", "\n".join(lines) + "\n")
    print(folder / "results.md")
    return all(one.standing.stands for one in closed.values())


def _table(group: str, closed: Closed) -> list[str]:
    verdict = closed.verdict
    lines = [f"## {group}", "", f"{verdict.kind} {', '.join(verdict.named)}: {verdict.reason}", ""]
    lines += ["| model | log probability over none [nat] | p of what it leaves |", "|---|---|---|"]
    for one in closed.trace.explanations[:6]:
        names = " + ".join(one.effects)
        lines.append(f"| {names} | {one.log_probability:.1f} | {one.p_after:.3g} |")
    lines += ["", *(f"- {text}" for text in closed.trace.beyond), ""]
    return lines
