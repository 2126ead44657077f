"""Numbers with intervals, and when one is better than the paper's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.experiments.paper.common.outcome import Row
from granulcal.experiments.paper.common.sizes import Size

__all__ = [
    "Published",
    "bootstrap",
    "bootstrap_grid",
    "bootstrap_pairs",
    "error_row",
    "level_row",
    "share_interval",
]

Array = NDArray[np.float64]

_RESAMPLES = 4000
_TAILS = (0.025, 0.975)


@dataclass(frozen=True, kw_only=True)
class Published:
    """A number of the paper: mean and standard deviation over its tests.

    Attributes:
        mean: the mean.
        sd: the standard deviation.
        count: tests behind it.
    """

    mean: float
    sd: float
    count: int

    @property
    def rms(self) -> float:
        """Root mean square, if the number is that of an error."""
        return float(np.hypot(self.mean, self.sd))

    def __str__(self) -> str:
        """As the paper prints it."""
        return f"{self.mean:.4f} ± {self.sd:.4f} (n = {self.count})"


def bootstrap(values: ArrayLike, of: str = "mean") -> tuple[float, float]:
    """Returns the 95 % interval of the mean, or of the root mean square, of `values` (n,).

    Percentiles of 4000 resamples; NaN for fewer than two values.

    Args:
        values: one for each test.
        of: `mean` or `rms`.
    """
    sample = np.asarray(values, float)
    if len(sample) < 2:
        return float("nan"), float("nan")
    rows = np.random.default_rng(0).integers(len(sample), size=(_RESAMPLES, len(sample)))
    drawn = sample[rows]
    each = np.sqrt(np.mean(drawn**2, axis=1)) if of == "rms" else drawn.mean(axis=1)
    low, high = np.quantile(each, _TAILS)
    return float(low), float(high)


def bootstrap_grid(values: ArrayLike) -> tuple[float, float]:
    """Returns the 95 % interval of the mean of `values` (n, m), of n tests with each of m others.

    Both are resampled, each by itself (Owen 2007, doi:10.1214/07-AOAS122): what is resampled along
    one side alone takes the others for known. NaN for fewer than two of either.
    """
    sample = np.asarray(values, float)
    if min(sample.shape) < 2:
        return float("nan"), float("nan")
    random = np.random.default_rng(0)
    rows, columns = (random.integers(n, size=(_RESAMPLES, n)) for n in sample.shape)
    each = sample[rows[:, :, None], columns[:, None]].mean(axis=(1, 2))
    low, high = np.quantile(each, _TAILS)
    return float(low), float(high)


def bootstrap_pairs(distances: ArrayLike) -> tuple[float, float]:
    """Returns the 95 % interval of the mean over pairs of n, whose `distances` are (n, n).

    The n are resampled, since n - 1 pairs share each of them; a pair of one with itself is none.
    NaN for fewer than three.
    """
    sample = np.asarray(distances, float)
    if len(sample) < 3:
        return float("nan"), float("nan")
    drawn = np.random.default_rng(0).integers(len(sample), size=(_RESAMPLES, len(sample)))
    apart = drawn[:, :, None] != drawn[:, None]
    # All one and the same: no pair is left.
    apart = apart[apart.any(axis=(1, 2))]
    drawn = drawn[(drawn != drawn[:, :1]).any(axis=1)]
    each = sample[drawn[:, :, None], drawn[:, None]]
    means = np.where(apart, each, 0.0).sum(axis=(1, 2)) / apart.sum(axis=(1, 2))
    low, high = np.quantile(means, _TAILS)
    return float(low), float(high)


def share_interval(hits: int, count: int) -> tuple[float, float]:
    """Returns Wilson's 95 % interval of a share."""
    z, share = 1.96, hits / count
    middle = (share + z**2 / (2 * count)) / (1 + z**2 / count)
    half = z * np.sqrt(share * (1 - share) / count + z**2 / (4 * count**2)) / (1 + z**2 / count)
    return float(middle - half), float(middle + half)


def error_row(
    quantity: str, errors: ArrayLike, size: Size, paper: Published | None = None, digits: int = 4
) -> Row:
    """Returns the row of signed errors; what is judged is their root mean square.

    Args:
        quantity: what it is.
        errors: estimate less truth of each test, shape (n,).
        size: of the run; only a full one is judged.
        paper: the paper's number.
        digits: after the point.
    """
    e = np.asarray(errors, float)
    rms, (low, high) = float(np.sqrt(np.mean(e**2))), bootstrap(e, "rms")
    return Row(
        quantity=quantity,
        paper="" if paper is None else str(paper),
        ours=f"{e.mean():.{digits}f} ± {_sd(e):.{digits}f}",
        interval=f"rms {rms:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"
        + ("" if paper is None else f"; paper {paper.rms:.{digits}f}"),
        count=len(e),
        verdict="" if paper is None else _verdict(low, high, paper.rms, len(e), paper, size),
    )


def level_row(
    quantity: str,
    values: ArrayLike,
    size: Size,
    paper: Published | None = None,
    digits: int = 4,
    *,
    interval: tuple[float, float] | None = None,
    count: int | None = None,
) -> Row:
    """Returns the row of a distance, of which less is better; what is judged is its mean.

    Args:
        quantity: what it is.
        values: of each test, shape (n,).
        size: of the run; only a full one is judged.
        paper: the paper's number.
        digits: after the point.
        interval: 95 % of the mean, where the values do not stand for themselves.
        count: tests behind it, where they are not the values.
    """
    v = np.asarray(values, float)
    low, high = bootstrap(v) if interval is None else interval
    tests = len(v) if count is None else count
    return Row(
        quantity=quantity,
        paper="" if paper is None else str(paper),
        ours=f"{v.mean():.{digits}f} ± {_sd(v):.{digits}f}",
        interval=f"mean {low:.{digits}f} to {high:.{digits}f}",
        count=tests,
        verdict="" if paper is None else _verdict(low, high, paper.mean, tests, paper, size),
    )


def _sd(values: Array) -> float:
    return float(values.std(ddof=1)) if len(values) > 1 else float("nan")


def _verdict(
    low: float, high: float, theirs: float, count: int, paper: Published, size: Size
) -> str:
    """Decided only by the whole interval, at a full run of at least as many tests."""
    if size.verdict:
        return size.verdict
    if count < paper.count:
        return "not decided: too few tests"
    if high < theirs:
        return "better"
    return "worse" if low > theirs else "not decided"
