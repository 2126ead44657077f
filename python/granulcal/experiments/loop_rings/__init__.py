"""The loop on rings: a ball of sand dropped on a loose bed of sand, both of coarse grains."""

from pathlib import Path

from granulcal.experiments._groups import close_groups, verdict_lines
from granulcal.experiments.loop_rings.picture import picture
from granulcal.experiments.loop_rings.seen import look, table
from granulcal.experiments.loop_rings.task import GROUPS, task
from granulcal.files import write_beside
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
    closed = close_groups(
        folder,
        {group: task(data, group) for group in GROUPS},
        budget=_BUDGET,
        command=f"granulcal reproduce loop_rings --out {out}",
        title="Rings on a loose bed",
    )
    seen = {group: look(one) for group, one in closed.items()}
    picture(folder / "rings.png", seen)
    lines = [
        line
        for group, one in closed.items()
        for line in (*verdict_lines(group, one), *table(seen[group]))
    ]
    write_beside(folder / "results.md", "\n".join(lines) + "\n")
    print(folder / "results.md")
    return all(one.standing.stands for one in closed.values())
