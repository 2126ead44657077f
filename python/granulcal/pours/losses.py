"""Tasks of a Ray cluster that are lost again and again, which no further trial will bring."""

from collections import Counter
from typing import Any

__all__ = ["Losses"]

_MOST = 5
"""Losses of one task that may be chance: Ray has started it again many times before each."""


class Losses:
    """Counts how often each task of one cluster was lost."""

    def __init__(self, ray: Any) -> None:
        self._ray = ray
        self._of: Counter[int] = Counter()

    def count(self, number: int, why: Exception) -> None:
        """Counts a loss of the task with this number.

        Raises:
            ChildProcessError: it has been lost too often for its workers to be lost by chance.
        """
        # Without nodes every task is lost, whatever it does; `Awaited` ends that.
        if not any(node["Alive"] for node in self._ray.nodes()):
            return
        self._of[number] += 1
        if self._of[number] >= _MOST:
            raise ChildProcessError(
                f"workers of the cluster die again and again of the same pours (task {number}): "
                "their machines may have too little memory for as many at once as they have "
                f"cores; what is done is kept, and the same command goes on with it; {why}"
            )
