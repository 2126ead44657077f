"""Rows of the tables that benches print: how often something held, and where values lie."""

from collections.abc import Sequence

import numpy as np
from scipy.stats import binomtest

__all__ = ["median", "rate"]


def rate(
    name: str, hits: Sequence[bool], target: str | None = None, *, method: str = "wilson"
) -> None:
    """Prints how often something held, with its 95 % interval.

    Args:
        name: of the row.
        hits: whether it held, each time.
        target: what is asked of it, where the table has a column for that.
        method: of the interval, as `proportion_ci` of scipy names it.
    """
    share, interval = f"{sum(hits)} of {len(hits)}", ""
    if hits:
        low, high = binomtest(sum(hits), len(hits)).proportion_ci(0.95, method)
        share += f" = {100 * sum(hits) / len(hits):.0f} %"
        interval = f"{100 * low:.0f} to {100 * high:.0f} %"
    _print(name, share, interval, target)


def median(name: str, values: Sequence[float | None], target: str | None = None) -> None:
    """Prints median and quartiles of those values that are known; nothing where none is."""
    known = [v for v in values if v is not None and np.isfinite(v)]
    if known:
        low, middle, high = np.quantile(known, [0.25, 0.5, 0.75])
        shown = f"{middle:.2f} ({low:.2f}, {high:.2f})"
        _print(f"{name}: median (quartiles), n = {len(known)}", shown, "", target)


def _print(name: str, value: str, interval: str, target: str | None) -> None:
    cells = [name, value, interval] if target is None else [name, value, interval, target]
    print(f"| {' | '.join(cells)} |")
