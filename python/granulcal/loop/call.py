"""What `close_loop` is called with, checked before anything is written or poured."""

from granulcal.errors import ObservationError
from granulcal.loop.check.coverage import FEWEST_PAIRS
from granulcal.loop.task import Task
from granulcal.whole import check_whole

__all__ = ["check_call"]


def check_call(
    task: Task, *, budget: int, threads: int | None, seed: int, pairs: int, rounds: int
) -> None:
    """Refuses a task that is none, and numbers that no loop has.

    Raises:
        TypeError: a file in place of the task, or a number that is not whole.
        ValueError: a number that is too small or too large.
        ObservationError: too few pairs to read an interval from.
    """
    if not isinstance(task, Task):
        raise TypeError(
            f"task must be a Task, got {task!r}: granulcal.Task.load reads the one in a file"
        )
    check_whole("budget", budget, at_least=1)
    if threads is not None:
        check_whole("threads", threads, at_least=1)
    # Seeds of pours lie above it, by up to 2^50.
    check_whole("seed", seed, at_least=0)
    check_whole("pairs", pairs, at_least=0)
    check_whole("rounds", rounds, at_least=0)
    if pairs and pairs < FEWEST_PAIRS:
        raise ObservationError(
            f"pairs must be 0, or at least {FEWEST_PAIRS} to read 95 % from, got {pairs}"
        )
