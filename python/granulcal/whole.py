"""Whole numbers as arguments, within what the Rust side can hold."""

import numpy as np

__all__ = ["LARGEST_SEED", "check_seed", "check_whole"]

LARGEST_SEED = 2**64 - 1
"""The largest seed of a pour and of a batch."""
_LARGEST = 2**63 - 1


def check_whole(name: str, value: int, *, at_least: int, at_most: int = _LARGEST) -> None:
    """Refuses what is not a whole number from `at_least` to `at_most`.

    Raises:
        TypeError: not a whole number.
        ValueError: too small or too large.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise TypeError(f"{name} must be a whole number, got {value!r}")
    if value < at_least:
        raise ValueError(f"{name} must be at least {at_least}, got {_shown(value)}")
    if value > at_most:
        raise ValueError(f"{name} must be at most {at_most}, got {_shown(value)}")


def check_seed(value: int, name: str = "seed") -> None:
    """Refuses what is not a seed: a whole number from 0 to 2^64 - 1.

    Raises:
        TypeError: not a whole number.
        ValueError: too small or too large.
    """
    check_whole(name, value, at_least=0, at_most=LARGEST_SEED)


def _shown(value: int) -> str:
    """Python writes no number of many thousand digits."""
    bits = int(value).bit_length()
    return str(value) if bits <= 256 else f"a number of {bits} bits"
