"""How much memory and time the surrogate of an archive and what follows of it take.

    python benches/loop_memory.py out/sets/set-001/loop.toml out/archive

of the sets and the archive of benches/blind; a missing archive is filled. Core seconds of each step
and the process's peak so far.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np

from granulcal.loop.close import fit_surrogate, planned
from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.conditioned import conditioned
from granulcal.loop.task import FIT, Task
from granulcal.loop.test.trace import power, trace

BUDGET, SEED, FURTHER = 3629, 1, 96


def main() -> None:
    """Fits, traces, learns `FURTHER` pours of the archive once more, and traces again."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", type=Path)
    parser.add_argument("archive", type=Path)
    options = parser.parse_args()
    task = Task.load(options.task)
    store = Archive(options.archive, planned(task, BUDGET, SEED))
    store.fill()
    said("before any fit")
    surrogate = fit_surrogate(store, seed=SEED)
    said("fit")
    observed = [
        ConditionPours.of(c.name, store.plan.unit(c.at), c.statistics(task.scene))
        for c in task.of(FIT)
    ]
    units = [one.condition for one in observed]
    power(surrogate, np.full(len(task.prior.names), 0.5), units, [len(o.pours) for o in observed])
    said("power")
    print(trace(surrogate, observed, seed=SEED).verdict.reason)
    said("trace")
    rows = store.pours()
    of = np.random.default_rng(SEED).permutation(len(rows))[:FURTHER]
    more = Rows(rows.theta[of], rows.condition[of], rows.psi[of], rows.x[of])
    later = conditioned(surrogate, more)
    said("conditioned")
    print(trace(later, observed, seed=SEED).verdict.reason)
    said("trace")


def said(step: str) -> None:
    """Prints core seconds and the peak of memory since the start."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{step}: {time.process_time():.0f} s of a core, {peak:.2f} GB", flush=True)


if __name__ == "__main__":
    main()
