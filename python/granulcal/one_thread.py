"""Linear algebra on one thread.

The sums of a product of matrices depend on how many threads share it, so that the same seed would
give another model on another machine; and threads that wait for each other over matrices as small
as ours take many times longer than one thread does, where other work has the cores.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from threading import Lock

import numpy as np  # noqa: F401  (its library of linear algebra has to be there to be found)
from threadpoolctl import ThreadpoolController

__all__ = ["one_thread"]

_lock = Lock()
_inside = 0
_restore: dict[str, Callable[[], None]] = {}


@contextmanager
def one_thread() -> Iterator[None]:
    """Keeps numpy, SciPy and torch to one thread meanwhile; also a decorator of functions.

    The number holds for the whole process. It is set by whoever comes first and put back by whoever
    leaves last, so that calls may nest and may come from several threads. What imports SciPy or
    torch inside enters once more afterwards.
    """
    global _inside
    with _lock:
        _limit()
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if _inside == 0:
                while _restore:
                    _restore.popitem()[1]()


def _limit() -> None:
    """Limits what is loaded and not limited yet: others may come while some are inside."""
    # SciPy brings a library of linear algebra of its own.
    for name in ("numpy", "scipy.linalg"):
        if name in sys.modules and name not in _restore:
            limited = _pools(name).limit(limits=1, user_api="blas")
            _restore[name] = limited.restore_original_limits
    torch = sys.modules.get("torch")
    if torch is not None and "torch" not in _restore:
        threads: int = torch.get_num_threads()
        torch.set_num_threads(1)
        _restore["torch"] = lambda: torch.set_num_threads(threads)


@cache
def _pools(_: str) -> ThreadpoolController:
    return ThreadpoolController()
