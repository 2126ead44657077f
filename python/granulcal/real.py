"""Real numbers as arguments, refused by their name before anything is computed of them."""

import numpy as np

__all__ = ["check_real"]


def check_real(name: str, value: object) -> None:
    """Refuses what is no real number: words, truth values, lists, None.

    Raises:
        TypeError: names the argument.
    """
    is_truth = isinstance(value, bool | np.bool_)
    if is_truth or isinstance(value, str) or not hasattr(value, "__float__"):
        raise TypeError(f"{name} must be a number, got {value!r}")
