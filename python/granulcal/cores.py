"""How many pours this process may make at once."""

import os

__all__ = ["cores"]


def cores() -> int:
    """Returns the cores that this process may use, at least 1.

    A job on a shared machine, of SLURM for example, has some of its cores: with a pour for each
    core of the machine they would crowd each other, and need the memory of all.
    """
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
