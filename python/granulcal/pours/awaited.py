"""Waits for tasks of a Ray cluster, but not for one whose nodes are all gone."""

import time
from collections.abc import Iterable
from typing import Any

__all__ = ["Awaited"]

_PATIENCE_S = 0.5
"""How long the driver waits for a task before it looks around [s]."""
_PATIENCE_OF_NODES_S = 30.0
"""How long no node may be alive: Ray needs some seconds to learn of a new one [s]."""


class Awaited:
    """The tasks of one cluster."""

    def __init__(self, ray: Any, patience_s: float = _PATIENCE_OF_NODES_S) -> None:
        self._ray, self._patience = ray, patience_s
        self._seen = time.monotonic()

    def done(self, tasks: Iterable[Any]) -> list[Any]:
        """Returns those that are done, none if it takes longer than a moment.

        Raises:
            ConnectionError: no node has been alive for so long that none will take them up.
        """
        done, _ = self._ray.wait(list(tasks), timeout=_PATIENCE_S)
        now = time.monotonic()
        # A task of a node that is gone is done, too: it is lost.
        if any(node["Alive"] for node in self._ray.nodes()):
            self._seen = now
        elif now - self._seen > self._patience:
            raise ConnectionError(
                f"no node of the Ray cluster has been alive for {self._patience:g} s; what is done "
                "is kept, and the same command goes on with it"
            )
        return list(done)
