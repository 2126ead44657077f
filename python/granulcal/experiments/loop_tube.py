"""The loop on columns by both fronts, each test's tube lifted at a speed of its own.

As `loop_liquid.py`, but for the tube: what one archive and one fit have as one number for all tests
there is an own error of each condition here. Thin liquid passes a gap that beads cannot, so that
how far it is ahead when the beads come out tells how fast the tube went up.
"""

from pathlib import Path

from granulcal.experiments._fronts import close_fronts
from granulcal.experiments.loop_liquid import BUDGET, OWN_ERRORS, ROUNDS
from granulcal.experiments.loop_liquid import task as by_both_fronts
from granulcal.experiments.predictions.column_pours import UNKNOWN
from granulcal.loop.task import Task
from granulcal.pours.pour_time import PourKind
from granulcal.prior import Prior

__all__ = ["reproduce", "task"]

_TUBE = "walls.0.motion.velocity.2"
# Of the scene's 1 m/s at 1 g: from 0.2 to 1.8 [m/s].
_SPEED = {_TUBE: {"sd": 0.4, "shared": False}}


def task(data: Path) -> Task:
    """Returns what is asked of the measured columns."""
    known = Prior([one for one in UNKNOWN.parameters if one.path != _TUBE])
    return by_both_fronts(data, known, {**OWN_ERRORS, **_SPEED})


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data)
    return [PourKind("the archive", asked.at_first(), asked.prior, BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop; report.html, verdict.json and fronts.png in `out`/loop_tube.

    Returns whether the verdict stands.
    """
    return close_fronts(
        task(data),
        out / "loop_tube",
        command=f"granulcal reproduce loop_tube --out {out}",
        title="Columns of beads and their liquid, each tube lifted at a speed of its own",
        budget=BUDGET,
        rounds=ROUNDS,
    )
