"""Whole numbers as arguments: pours, seeds and threads, refused before anything is begun."""

import argparse
import os

__all__ = ["pour_count", "seed_number", "thread_count"]

_MOST = 100_000
# Seeds of the pours of a run are multiples of it, below 2^64.
_LARGEST_SEED = 10**13


def pour_count(text: str) -> int:
    """Returns a number of pours; more than the limit where the environment lifts limits.

    Raises:
        argparse.ArgumentTypeError: no whole number, or one that no machine has room or time for.
    """
    count = _whole(text)
    if count > _MOST and os.environ.get("GRANULCAL_NO_LIMITS") != "1":
        raise argparse.ArgumentTypeError(
            f"must be at most {_MOST} pours, got {text}; GRANULCAL_NO_LIMITS=1 in the environment "
            "starts it all the same"
        )
    return count


def seed_number(text: str) -> int:
    """Returns a seed.

    Raises:
        argparse.ArgumentTypeError: no whole number, or one that is too small or too large.
    """
    seed = _whole(text)
    if not 0 <= seed <= _LARGEST_SEED:
        raise argparse.ArgumentTypeError(f"must be from 0 to {_LARGEST_SEED}, got {text}")
    return seed


def thread_count(text: str) -> int:
    """Returns a number of threads.

    Raises:
        argparse.ArgumentTypeError: no whole number, or less than one.
    """
    count = _whole(text)
    if count < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {text}")
    return count


def _whole(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text!r}") from None
