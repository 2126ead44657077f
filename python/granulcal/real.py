"""Real numbers as arguments, refused by their name before anything is computed of them."""

import numpy as np

__all__ = ["check_finite", "check_real"]


def check_real(name: str, value: object) -> None:
    """Refuses what is no real number: words, truth values, lists, None.

    Raises:
        TypeError: names the argument.
    """
    is_truth = isinstance(value, bool | np.bool_)
    is_list = np.ndim(value) > 0 if isinstance(value, np.ndarray) else False
    if is_truth or is_list or isinstance(value, str) or not hasattr(value, "__float__"):
        raise TypeError(f"{name} must be a number, got {value!r}")


def check_finite(name: str, value: object) -> None:
    """Refuses what is no real number, and NaN and infinities.

    Raises:
        TypeError: names the argument.
        ValueError: likewise.
    """
    check_real(name, value)
    if not np.isfinite(value):  # pyright: ignore[reportArgumentType, reportCallIssue]
        raise ValueError(f"{name} must be finite, got {value}")
