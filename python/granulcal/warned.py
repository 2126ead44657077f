"""What a command line is warned of: on stderr, a line each."""

import sys
from collections.abc import Iterable

from granulcal import _native

__all__ = ["warn"]


def warn(told: Iterable[str]) -> None:
    """Prints each as a warning; names in a stranger's file steer no terminal and fill none."""
    for each in told:
        print(f"warning: {_native.readable(each)}", file=sys.stderr)
