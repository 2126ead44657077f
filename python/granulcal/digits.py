"""Numbers that stand beside each other, with digits enough to tell them apart."""

import math
from collections.abc import Sequence

__all__ = ["told_apart"]

# No float has more.
_MOST = 17


def told_apart(values: Sequence[float], *, least: int) -> list[str]:
    """Returns the values with so many digits that the range they span has two, at least `least`.

    An interval of 2499.5 to 2501.8 is none in three digits.

    Args:
        values: at least one.
        least: digits where the range is wide.
    """
    size, span = max(map(abs, values)), max(values) - min(values)
    digits = least
    if 0 < span < math.inf:
        needed = math.floor(math.log10(size)) - math.floor(math.log10(span)) + 2
        digits = min(max(least, needed), _MOST)
    return [f"{value:.{digits}g}" for value in values]
