"""Intervals that hold one further pour, from few pours."""

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

__all__ = ["fewest_of_ranks", "of_one_more", "t_factor"]

Array = NDArray[np.float64]


def t_factor(level: float, freedom: float) -> float:
    """Returns how many standard deviations with so many degrees of freedom hold `level`."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, (1 + level) / 2))


def fewest_of_ranks(level: float) -> int:
    """Returns how many pours have a rank at either end of the interval."""
    q, count = (1 - level) / 2, max(int(2 / (1 - level)) - 2, 0)
    while q * (count + 1) < 1:
        count += 1
    return count


def of_one_more(rows: Array, level: float, pours: int) -> tuple[Array, Array]:
    r"""Returns the ends of the interval that holds one more pour, by statistic, shape (s,) each.

    One of n + 1 pours is as likely to be at any rank: where there are ranks enough the ends are of
    ranks q (n + 1) and (1 - q) (n + 1), q = (1 - level) / 2; else those of Student's t for normal
    statistics, mean -+ t sd sqrt(1 + 1/n). By what draws of one pour differ is known: its spread w
    counts with the normal's z beside that of pours b, as $\sqrt{t^2 b^2 (1 + 1/n) + z^2 w^2}$.

    Args:
        rows: draws, as many of each pour, those of one together, shape (n, s).
        level: of the interval.
        pours: that the draws are of.
    """
    q = (1 - level) / 2
    if pours >= fewest_of_ranks(level):
        # Hazen's positions, in which the rank of a pour is that of the middle of its draws.
        end = (q * (pours + 1) - 0.5) / pours
        low, high = np.quantile(rows, [end, 1 - end], axis=0, method="hazen")
        return low, high
    each = rows.reshape(pours, -1, rows.shape[1])
    count = each.shape[1]
    within = each.var(axis=1, ddof=1).mean(axis=0) if count > 1 else np.zeros(rows.shape[1])
    between = np.maximum(each.mean(axis=1).var(axis=0, ddof=1) - within / count, 0.0)
    of_pours = t_factor(level, pours - 1) * np.sqrt((1 + 1 / pours) * between)
    half = np.hypot(of_pours, NormalDist().inv_cdf(1 - q) * np.sqrt(within))
    middle = rows.mean(axis=0)
    return middle - half, middle + half
