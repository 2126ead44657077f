"""The engine that pours for a whole job: a loop or a plan asks it wherever it would ask ours."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from granulcal import _native

if TYPE_CHECKING:
    from granulcal.engines.protocol import Engine
    from granulcal.pours.scene import Scene

__all__ = ["engine_in_use", "law_of_pours", "pouring_with", "required", "version_of_pours"]

# Not a context variable: the pours of a job run in threads of their own.
_in_use: "Engine | None" = None


@contextmanager
def pouring_with(engine: "Engine | None") -> Iterator[None]:
    """Lets `simulate` and `generate` ask `engine` where they are given none, in all threads.

    Args:
        engine: None for ours.

    Raises:
        RuntimeError: another job of this process has an engine in use.
    """
    global _in_use
    if _in_use is not None:
        raise RuntimeError(f"engine {_in_use.name} is in use already: one engine at a time")
    _in_use = engine
    try:
        yield
    finally:
        _in_use = None


def required(engine: "Engine | None") -> "Engine | None":
    """Returns what was given for an engine, if it can be one.

    Raises:
        TypeError: a name, or a function by itself; says what makes an engine of it.
    """
    if isinstance(engine, str):
        told = f"granulcal.engines.engine_named({engine!r})"
        raise TypeError(f"engine must be an Engine, got the name {engine!r}: {told} is the one")
    if engine is not None and not hasattr(engine, "name"):
        told = "granulcal.engines.CallableEngine(function) makes one of a function"
        raise TypeError(f"engine must be an Engine, got {engine!r}: {told}")
    return engine


def engine_in_use() -> "Engine | None":
    """Returns the engine of the job that runs, None for ours."""
    return _in_use


def law_of_pours(scene: "Scene") -> int:
    """Returns the number of the law that pours of a scene follow, 0 where another engine pours."""
    return scene.native.law if _in_use is None else 0


def version_of_pours() -> str:
    """Returns what kept pours are of: granulcal's version, and the engine's name where one pours."""
    name = "" if _in_use is None else f", pours by {_in_use.name}"
    return f"{_native.__version__}{name}"
