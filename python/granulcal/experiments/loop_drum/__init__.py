"""The loop on a rotating drum of MCC spheres: one time-averaged picture at each of two speeds.

Fitted are both speeds; as a cross-check each is fitted alone with the other sealed, from the same
pours. What the model predicts at speeds that were not measured here is written down, too.
"""

from pathlib import Path

from granulcal.experiments.loop_drum.report import compare_speeds, table
from granulcal.experiments.loop_drum.task import task
from granulcal.files import write_beside
from granulcal.loop.close import close_loop
from granulcal.loop.report.folder import write_report
from granulcal.pours.pour_time import PourKind

__all__ = ["reproduce", "task"]

# Some three hours and a half of one core: 13 to 18 s a pour of 1.7 mm, a third of that of 2.4 mm.
_BUDGET = 1150
# Which speeds are fitted; the others are sealed.
_ASKED = {"both": (15, 45), "fit-15": (15,), "fit-45": (45,)}


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data)
    return [PourKind("the archive", asked.at_first(), asked.prior, _BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop on both speeds and on each alone; results.md and pages in `out`/loop_drum.

    Returns whether every verdict stands.
    """
    folder = out / "loop_drum"
    surrogate, stands = None, True
    for name, fitted in _ASKED.items():
        asked = task(data, fitted)
        closed = close_loop(
            asked,
            folder / name,
            archive=folder / "archive",
            budget=_BUDGET,
            pairs=0,
            surrogate=surrogate,
        )
        stands &= closed.standing.stands
        if surrogate is None:
            # The pours are the same whatever is fitted, and so is what they say.
            surrogate = closed.trace.local.surrogate
        write_report(
            closed,
            folder / name,
            command=f"granulcal reproduce loop_drum --out {out}",
            title=f"MCC spheres in a drum, fitted at {' and '.join(map(str, fitted))} rpm",
        )
        if name == "both":
            text = "\n".join(table(closed, compare_speeds(closed, folder))) + "\n"
            write_beside(folder / "results.md", text)
            print(folder / "results.md")
    return stands
