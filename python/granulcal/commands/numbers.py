"""Numbers as arguments with a bound, refused before anything is begun."""

import argparse
import math
from collections.abc import Callable

from granulcal.commands.counts import pour_count

__all__ = ["at_least", "positive", "probability"]


def at_least(least: int) -> Callable[[str], int]:
    """Returns the type of a number of pours that must be at least `least`."""

    def count(text: str) -> int:
        found = pour_count(text)
        if found < least:
            raise argparse.ArgumentTypeError(f"must be at least {least}, got {text}")
        return found

    return count


def probability(text: str) -> float:
    """Returns a number between 0 and 1, without the ends.

    Raises:
        argparse.ArgumentTypeError: no number, or another one.
    """
    value = _number(text)
    if not 0 < value < 1:
        raise argparse.ArgumentTypeError(f"must lie between 0 and 1, got {text}")
    return value


def positive(text: str) -> float:
    """Returns a positive finite number.

    Raises:
        argparse.ArgumentTypeError: no number, or another one.
    """
    value = _number(text)
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f"must be positive, got {text}")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, got {text!r}") from None
