"""Several pours at once: on this machine's threads, or on the cluster that the job has.

A task of a cluster is one pour here, where `generate` has parts of 16: these batches are small,
and their rows are wanted one by one.
"""

from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import Any, TypeVar

from granulcal import _native
from granulcal.engines.in_use import engine_in_use
from granulcal.pours.awaited import Awaited
from granulcal.pours.cluster import (
    AHEAD,
    RETRIES,
    LostResultError,
    cluster_in_use,
    connected,
    refuse_engine,
    result_of,
)
from granulcal.pours.losses import Losses

__all__ = ["at_once"]

Of = TypeVar("Of")
Row = TypeVar("Row")


def at_once(
    work: Callable[[Of], Row], each: Sequence[Of], threads: int
) -> Generator[tuple[int, Row], None, None]:
    """Yields the place of each in `each` and what `work` makes of it, as they are done.

    Args:
        work: makes one; a function that can be pickled where the job has a cluster.
        each: what is asked of it.
        threads: at once, on this machine.

    Raises:
        ValueError: a worker of the cluster has another granulcal, or the job another engine.
        ChildProcessError: workers of the cluster die of one of them again and again.
    """
    if cluster_in_use() is None or not each:
        yield from _on_threads(work, each, threads)
    else:
        yield from _on_cluster(work, each)


def _on_threads(
    work: Callable[[Of], Row], each: Sequence[Of], threads: int
) -> Generator[tuple[int, Row], None, None]:
    workers = ThreadPoolExecutor(threads)
    try:
        jobs = {workers.submit(work, one): place for place, one in enumerate(each)}
        for job in as_completed(jobs):
            yield jobs[job], job.result()
    finally:
        # Whoever stops it, by Ctrl-C above all, does not wait for the pours that are under way.
        workers.shutdown(wait=False, cancel_futures=True)


def _on_cluster(
    work: Callable[[Of], Row], each: Sequence[Of]
) -> Generator[tuple[int, Row], None, None]:
    refuse_engine(engine_in_use())
    ray = connected()
    remote = ray.remote(num_cpus=1, max_retries=RETRIES)(_one)
    waiting, tasks = deque(range(len(each))), {}
    shared, awaited, losses = ray.put(work), Awaited(ray), Losses(ray)
    try:
        while waiting or tasks:
            cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
            while waiting and len(tasks) < AHEAD * cores:
                place = waiting.popleft()
                tasks[remote.remote(shared, each[place], _law())] = place
            for reference in awaited.done(tasks):
                place = tasks.pop(reference)
                try:
                    row = result_of(ray, reference)
                except LostResultError as error:
                    losses.count(place, error)
                    waiting.append(place)
                    continue
                yield place, row
    finally:
        for reference in tasks:
            ray.cancel(reference, force=True)


def _one(work: Callable[[Any], Any], one: Any, law: tuple[str, int]) -> Any:
    """Makes one on a worker, which has to have the driver's granulcal."""
    if _law() != law:
        own, asked = (f"{version} (law {number})" for version, number in (_law(), law))
        raise ValueError(f"a worker of the cluster has granulcal {own}, the driver {asked}")
    return work(one)


def _law() -> tuple[str, int]:
    return _native.__version__, _native.LAW
