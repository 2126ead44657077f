"""Numbers of pours as arguments: more than anybody waits for are refused before the first."""

import argparse
import os

__all__ = ["pour_count"]

_MOST = 100_000


def pour_count(text: str) -> int:
    """Returns a number of pours; more than the limit where the environment lifts limits.

    Raises:
        argparse.ArgumentTypeError: no whole number, or one that no machine has room or time for.
    """
    try:
        count = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, got {text!r}") from None
    if count > _MOST and os.environ.get("GRANULCAL_NO_LIMITS") != "1":
        raise argparse.ArgumentTypeError(
            f"must be at most {_MOST} pours, got {text}; GRANULCAL_NO_LIMITS=1 in the environment "
            "starts it all the same"
        )
    return count
