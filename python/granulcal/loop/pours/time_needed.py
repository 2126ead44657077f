"""How long an analysis takes, told before it pours."""

import numpy as np

from granulcal.loop.pours.archive import Archive
from granulcal.loop.task import Task
from granulcal.pours.pour_time import in_the_middle, pour_time
from granulcal.progress import duration

__all__ = ["time_needed"]

# Conditions under which a pour is timed, evenly taken from all.
_TIMED = 3


def time_needed(task: Task, store: Archive, further: int, threads: int) -> str:
    """Returns a sentence: pours that are missing, what one takes here, and all of them.

    A pour is timed at the median of the prior, without any effect; the surrogate's fits and tests,
    minutes of one core, are not in it.

    Args:
        task: what is asked.
        store: its archive.
        further: pours beside the archive.
        threads: pours at once.
    """
    conditions, missing = task.conditions, store.missing
    chosen = np.unique(np.linspace(0, len(conditions) - 1, _TIMED).round().astype(int))
    middle = in_the_middle(task.scene, task.prior)
    each = pour_time([middle.with_(conditions[i].at) for i in chosen.tolist()]).seconds
    total = missing + further
    return (
        f"{missing} pours of the archive are missing, {further} follow, and more where a fit is "
        f"looked at again: at {each:.2g} s each, {threads} at once, about "
        f"{duration(total * each / threads)}"
    )
