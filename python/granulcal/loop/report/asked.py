"""A condition that a closed loop is asked for: its numbers, and how far it is from the measured."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.test.score import DISCREPANCY_LENGTH

__all__ = [
    "REACH",
    "condition_of",
    "require_near",
    "require_shared",
    "require_stated",
    "shown_outside",
    "shown_unlike",
]

Array = NDArray[np.float64]

REACH = 0.5 * DISCREPANCY_LENGTH
"""Nothing without physics is told farther from the measured conditions, in the unit range."""
# No number of a scene is larger.
_LARGEST = 1e100
# Of a range, what rounding may add.
_SAME = 1e-9


def condition_of(words: Sequence[str]) -> dict[str, float]:
    """Returns numbers of a condition written `path=number`.

    Raises:
        ObservationError: a word that is not, no finite number, or a path that is stated twice.
    """
    found: dict[str, float] = {}
    for word in words:
        path, _, value = word.partition("=")
        number = _number(value)
        if not path or number is None:
            raise ObservationError(
                "a condition is written path=number, for example funnel.height=0.07, its number "
                f"finite; got {word!r}"
            )
        if path in found:
            raise ObservationError(f"a condition states each path once, got {path} twice")
        found[path] = number
    return found


def _number(text: str) -> float | None:
    """Returns a number as `--set` takes it, before a comment; None of what is none."""
    try:
        number = float(text.partition("#")[0])
    except ValueError:
        return None
    return number if -_LARGEST <= number <= _LARGEST else None


def require_stated(model: str, at: Iterable[str], known: Sequence[str]) -> None:
    """Refuses numbers that no condition of the loop states: a model without physics ignores them.

    Raises:
        ObservationError: names them, and what the conditions state.
    """
    others = [path for path in at if path not in known]
    if others:
        raise ObservationError(
            f"{model} knows the numbers that the loop's conditions state alone, "
            f"{', '.join(known)}; it would ignore {', '.join(others)}"
        )


def require_shared(model: str, at: Mapping[str, float], shared: Mapping[str, float]) -> None:
    """Refuses another number than the one that all conditions share: nothing tells what it does.

    Args:
        model: that knows no physics.
        at: numbers of the condition.
        shared: what every condition of the loop states, by path.

    Raises:
        ObservationError: the number, and what the conditions state.
    """
    unlike = shown_unlike(at, shared)
    if unlike:
        raise ObservationError(
            f"{model} knows no physics and holds where the loop's conditions are alone: "
            f"{'; '.join(unlike)}"
        )


def shown_unlike(
    at: Mapping[str, float], known: Mapping[str, float], whose: str = "all its conditions"
) -> list[str]:
    """Returns a phrase for each number of a condition that is another than the known one."""
    return [
        f"{path} = {at[path]:g} is not the {value:g} of {whose}"
        for path, value in known.items()
        if path in at and abs(at[path] - value) > _SAME * max(abs(value), abs(at[path]))
    ]


def require_near(model: str, at: Array, conditions: Array) -> None:
    """Refuses a place farther from the measured conditions than the correction holds.

    Args:
        model: that tells it.
        at: unit coordinates, shape (q,).
        conditions: measured, unit coordinates, shape (H, q).

    Raises:
        ObservationError: says how far it is.
    """
    low, high = conditions.min(axis=0), conditions.max(axis=0)
    outside = float(np.linalg.norm(np.maximum(low - at, 0) + np.maximum(at - high, 0)))
    if outside > REACH:
        raise ObservationError(
            f"{model} holds up to {REACH:g} (unit range) outside the measured conditions, asked "
            f"for {outside:.3g}"
        )


def shown_outside(at: Mapping[str, float], inputs: Sequence[tuple[str, float, float]]) -> list[str]:
    """Returns a phrase for each number of a condition that lies outside those of the loop."""
    found = []
    for path, low, high in inputs:
        slack = _SAME * (high - low)
        if path in at and not low - slack <= at[path] <= high + slack:
            found.append(f"{path} = {at[path]:g} is outside {low:g} to {high:g}")
    return found
