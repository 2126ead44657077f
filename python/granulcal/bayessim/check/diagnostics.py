"""Is a posterior calibrated? Ranks and coverage of true parameters, with the band of chance.

All checks take any objects with `sample(n, seed)` and `log_prob(theta)`, one for each true
parameter, drawn from the prior together with its observation.

Reference:
    Talts, Betancourt, Simpson, Vehtari and Gelman, Validating Bayesian inference algorithms with
    simulation-based calibration, arXiv:1804.06788, 2018.
    Lemos, Coogan, Hezaveh and Perreault-Levasseur, Sampling-based accuracy testing of posterior
    estimators for general inference, ICML 2023 (TARP).
    Hermans et al., A trust crisis in simulation-based inference?, TMLR 2022 (expected coverage).
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.arrays import as_matrix
from granulcal.files import save_figure
from granulcal.progress import steps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "Coverage",
    "CoverageCount",
    "RankTest",
    "Tarp",
    "binomial_band",
    "expected_coverage",
    "plot_coverage",
    "plot_sbc",
    "sbc_ranks",
    "tarp",
    "uniform_p_value",
]

Array = NDArray[np.float64]

_LEVELS = (0.5, 0.8, 0.9, 0.95)
_COLOUR, _BAND_COLOUR = "#1f5f8b", "#c9ced3"


class Samplable(Protocol):
    """What the checks ask of a posterior."""

    def sample(self, n: int, seed: int = 0) -> Array:
        """Returns `n` draws, shape (n, p)."""
        ...

    def log_prob(self, theta: Any) -> Array:
        """Returns the log density at `theta` (n, p), shape (n,)."""
        ...


@dataclass(frozen=True)
class CoverageCount:
    """How many true parameters lay inside the highest-density region of one level.

    Attributes:
        level: nominal share.
        inside: truths found inside.
        total: truths examined.
        low: smallest `inside` that chance allows.
        high: largest `inside` that chance allows.
    """

    level: float
    inside: int
    total: int
    low: int
    high: int

    @property
    def is_within_band(self) -> bool:
        """Whether chance alone explains the count."""
        return self.low <= self.inside <= self.high


@dataclass(frozen=True)
class Coverage:
    """Expected coverage of highest-density regions.

    Attributes:
        truth_levels: smallest level whose region holds each truth; uniform on [0, 1] if the
            posteriors are calibrated, shape (n,).
        counts: one count for each level asked for; their bands hold jointly at 95 %.
    """

    truth_levels: Array
    counts: tuple[CoverageCount, ...]

    @property
    def is_calibrated(self) -> bool:
        """Whether every count lies in its band."""
        return all(count.is_within_band for count in self.counts)


@dataclass(frozen=True)
class RankTest:
    """Rank of each true parameter among draws of its posterior.

    Attributes:
        ranks: number of draws below the truth, 0 .. draw_count, shape (n, p).
        draw_count: draws of each posterior.
        p_values: Kolmogorov-Smirnov p-value of uniform ranks, for each parameter, shape (p,).
    """

    ranks: NDArray[np.int64]
    draw_count: int
    p_values: Array

    def is_calibrated(self, *, significance: float = 0.05) -> bool:
        """Whether no parameter's ranks differ from uniform, Bonferroni-corrected."""
        return bool(self.p_values.min() >= significance / len(self.p_values))


@dataclass(frozen=True)
class Tarp:
    """Coverage of balls around random points.

    Attributes:
        shares: share of a posterior's draws nearer to the random point than the truth is; uniform
            on [0, 1] if the posteriors are right, shape (n,).
        p_value: Kolmogorov-Smirnov p-value of uniform shares.
    """

    shares: Array
    p_value: float


def binomial_band(total: int, share: float, *, probability: float = 0.95) -> tuple[int, int]:
    """Returns the central range of Binomial(total, share) that holds at least `probability`."""
    tail = (1 - probability) / 2
    counts = np.arange(total + 1)
    log_choose = np.array(
        [math.lgamma(total + 1) - math.lgamma(k + 1) - math.lgamma(total - k + 1) for k in counts]
    )
    mass = np.exp(log_choose + counts * math.log(share) + (total - counts) * math.log1p(-share))
    below = np.cumsum(mass)
    return int(np.searchsorted(below, tail)), int(np.searchsorted(below, 1 - tail))


def expected_coverage(
    posteriors: Iterable[Samplable],
    theta: ArrayLike,
    *,
    levels: Sequence[float] = _LEVELS,
    draw_count: int = 1000,
    seed: int = 0,
    significance: float = 0.05,
) -> Coverage:
    """Returns how often highest-density regions hold the truth.

    Args:
        posteriors: one for each row of `theta`; may be a generator.
        theta: true parameters, own units, shape (n, p).
        levels: nominal shares, each between 0 and 1.
        draw_count: draws of each posterior.
        seed: seed of the draws.
        significance: chance that a calibrated posterior leaves any of the bands.
    """
    for level in levels:
        if not 0 < level < 1:
            raise ValueError(f"levels must lie between 0 and 1, got {level}")
    truth = as_matrix("theta", theta)
    shares = []
    for i, posterior in enumerate(_matched(posteriors, truth)):
        # Regions of our own posteriors are regions of the prior's coordinates.
        log_density = getattr(posterior, "coordinate_log_prob", posterior.log_prob)
        draws = posterior.sample(draw_count, seed=seed + i)
        shares.append(float(np.mean(log_density(draws) > log_density(truth[i : i + 1])[0])))
    truth_levels = np.array(shares)
    probability = 1 - significance / len(levels)
    counts = []
    for level in levels:
        band = binomial_band(len(truth), level, probability=probability)
        counts.append(CoverageCount(level, int(np.sum(truth_levels < level)), len(truth), *band))
    return Coverage(truth_levels, tuple(counts))


def sbc_ranks(
    posteriors: Iterable[Samplable], theta: ArrayLike, *, draw_count: int = 200, seed: int = 0
) -> RankTest:
    """Returns the ranks of the true parameters and whether they are uniform.

    Args:
        posteriors: one for each row of `theta`; may be a generator.
        theta: true parameters, own units, shape (n, p).
        draw_count: draws of each posterior.
        seed: seed of the draws.
    """
    truth = as_matrix("theta", theta)
    rows = [
        np.sum(posterior.sample(draw_count, seed=seed + i) < truth[i], axis=0)
        for i, posterior in enumerate(_matched(posteriors, truth))
    ]
    ranks = np.array(rows, dtype=np.int64)
    # Spread evenly inside its step, a uniform rank is uniform on [0, 1].
    jitter = np.random.default_rng(seed).random(ranks.shape)
    p_values = np.array([uniform_p_value(c) for c in ((ranks + jitter) / (draw_count + 1)).T])
    return RankTest(ranks, draw_count, p_values)


def tarp(
    posteriors: Iterable[Samplable],
    theta: ArrayLike,
    points: ArrayLike,
    *,
    draw_count: int = 1000,
    seed: int = 0,
    coordinates: Callable[[Array], Array] | None = None,
) -> Tarp:
    """Returns the coverage of balls around random points, which need no density.

    Over all random points a posterior passes only if it is the true one (Lemos et al. 2023,
    theorem 3); with one point for each truth it is one more test beside ranks and regions.

    Args:
        posteriors: one for each row of `theta`; may be a generator.
        theta: true parameters, own units, shape (n, p).
        points: random points, own units, shape (n, p), for example draws of the prior.
        draw_count: draws of each posterior.
        seed: seed of the draws.
        coordinates: map of parameters (m, p) to where distances are taken; None: as they are.
    """
    truth, centres = as_matrix("theta", theta), as_matrix("points", points)
    shares = []
    for i, posterior in enumerate(_matched(posteriors, truth)):
        rows = np.concatenate(
            [centres[i : i + 1], truth[i : i + 1], posterior.sample(draw_count, seed=seed + i)]
        )
        placed = rows if coordinates is None else coordinates(rows)
        distances = np.linalg.norm(placed[1:] - placed[0], axis=1)
        shares.append(float(np.mean(distances[1:] < distances[0])))
    values = np.array(shares)
    jitter = np.random.default_rng(seed).random(len(values))
    spread = (values * draw_count + jitter) / (draw_count + 1)
    return Tarp(values, uniform_p_value(spread))


def plot_coverage(coverage: Coverage, path: str | PathLike[str] | None = None) -> "Figure":
    """Returns a figure of found against nominal coverage with the 95 % band of chance."""
    figure, axis = _new_figure()
    total = len(coverage.truth_levels)
    nominal = np.linspace(0.01, 0.99, 99)
    band = np.array([binomial_band(total, level) for level in nominal]) / total
    found = [np.mean(coverage.truth_levels < level) for level in nominal]
    axis.fill_between(nominal, *band.T, color=_BAND_COLOUR, linewidth=0, label="95 % of chance")
    axis.plot([0, 1], [0, 1], color="black", linewidth=0.8, linestyle=":")
    axis.plot(nominal, found, color=_COLOUR, linewidth=1.8, label=f"{total} truths")
    axis.set(xlim=(0, 1), ylim=(0, 1), xlabel="nominal level", ylabel="share of truths inside")
    axis.legend(frameon=False, loc="upper left")
    if path is not None:
        save_figure(figure, path, dpi=160)
    return figure


def plot_sbc(
    test: RankTest,
    path: str | PathLike[str] | None = None,
    *,
    names: Sequence[str] | None = None,
    bins: int = 20,
) -> "Figure":
    """Returns histograms of the ranks, one for each parameter, with the band of chance."""
    count, dimension = test.ranks.shape
    figure, axes = _new_figure(dimension)
    low, high = binomial_band(count, 1 / bins)
    for i, axis in enumerate(np.atleast_1d(axes)):
        axis.axhspan(low, high, color=_BAND_COLOUR, linewidth=0, label="95 % of chance, each bar")
        edges = np.linspace(0, test.draw_count + 1, bins + 1) - 0.5
        # Outlines, so that the band can be seen behind low bars too.
        axis.hist(test.ranks[:, i], bins=edges, histtype="step", color=_COLOUR, linewidth=1.5)
        label = names[i] if names is not None else f"parameter {i}"
        axis.set(xlabel=f"draws below the truth, {label}", xlim=(edges[0], edges[-1]))
        axis.set_ylim(0, max(axis.get_ylim()[1], 1.6 * high))
        axis.set_title(f"flat if calibrated: p = {test.p_values[i]:.2g}", fontsize=9)
        if i == 0:
            axis.set(ylabel=f"truths, of {count}")
            axis.legend(frameon=False, loc="upper left", fontsize=8)
    if path is not None:
        save_figure(figure, path, dpi=160)
    return figure


def _new_figure(columns: int = 1) -> tuple["Figure", Any]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.6 * columns, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(1, columns)


def _matched(posteriors: Iterable[Samplable], truth: Array) -> Iterable[Samplable]:
    """Yields the posteriors; refuses more or fewer than rows of `truth`."""
    found = 0
    if isinstance(posteriors, Sequence):
        posteriors = steps("check", posteriors)
    for posterior in posteriors:
        found += 1
        if found > len(truth):
            break
        yield posterior
    if found != len(truth) or found == 0:
        more = "more" if found > len(truth) else f"{found}"
        raise ValueError(f"posteriors must be one for each of {len(truth)} truths, got {more}")


def uniform_p_value(values: Array) -> float:
    """Kolmogorov-Smirnov p-value of uniform `values`, by the limiting series with Stephens' fix."""
    count = len(values)
    ordered = np.sort(values)
    steps = np.arange(count + 1) / count
    distance = max(float(np.max(steps[1:] - ordered)), float(np.max(ordered - steps[:-1])))
    scaled = (math.sqrt(count) + 0.12 + 0.11 / math.sqrt(count)) * distance
    # The series converges slowly where the p-value is 1 anyway.
    if scaled < 0.3:
        return 1.0
    terms = [(-1) ** (j - 1) * math.exp(-2 * (j * scaled) ** 2) for j in range(1, 101)]
    return min(1.0, max(0.0, 2 * sum(terms)))
