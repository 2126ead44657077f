r"""A verdict's own pours in place of the surrogate: is the model adequate, and how strong is it?

The surrogate's error at a fit makes its test of adequacy blunt and its strengths biased. Fresh
pours of the model at its fit $\hat w = (\hat v, \hat\psi)$ have no such error. With their means
$\bar x$ beside the measured ones $\bar y$,

$$ r = \bar y - \bar x, \qquad S = \mathrm{diag}_h\, s R_h s \left( \frac1{n_h} + \frac1{f_h}
   \right) + N, \qquad
   \Delta = (J^T S^{-1} J + \Lambda)^{-1} (J^T S^{-1} r - \Lambda \hat w) $$

n measured and f fresh pours of each condition, N of the declared nuisances. The fit moves to
$\hat w + \Delta$, and only the slopes J are the surrogate's: their error is of second order.
$r - J \Delta$ is the efficient residual, and takes the same test as any fit (`residual_test.py`);
strengths have the normal $(\hat\psi + \Delta_\psi, (J^T S^{-1} J + \Lambda)^{-1})$, cut to the
prior's box.

Reference:
    Gourieroux, Monfort and Renault, Indirect inference, J. Applied Econometrics 8, 1993: moments of
    pours at the estimate in place of an approximate model's.
    Neyman and Scott, Consistent estimates based on partially consistent observations, 1948: one
    step of the score from any good estimate is efficient.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.residual_test import ResidualTest, residual_test
from granulcal.loop.test.score import Scores
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["Recentred", "gap_of", "misfit", "recentre"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recentred:
    """What fresh pours of a model at its fit say.

    Attributes:
        residual_test: the test of what is left.
        v: parameters' z-scores after the step, shape (p,).
        strengths: of the model's effects after the step, shape (|A|,).
        intervals: of these, shape (|A|, 2).
        step: length of the step in standard deviations of the moved fit.
    """

    residual_test: ResidualTest
    v: Array
    strengths: Array
    intervals: Array
    step: float

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "p": self.residual_test.p,
            "strengths": self.strengths.tolist(),
            "intervals": self.intervals.tolist(),
            "step": self.step,
        }


def recentre(
    surrogate: Surrogate,
    fit: Fit,
    measured: Sequence[ConditionPours],
    fresh: Sequence[ConditionPours],
    rules: Thresholds,
    *,
    seed: int = 0,
) -> Recentred:
    """Returns what fresh pours of a model at its fit say of the measured ones.

    Args:
        surrogate: whose slopes and noise are used.
        fit: of the model.
        measured: pours under the conditions to fit.
        fresh: pours of the model at the fit under the same conditions, in their order.
        rules: level of the intervals, numbers of replicates.
        seed: of the replicates.
    """
    local, root, gap = gap_of(surrogate, fit, measured, fresh)
    slopes = local.slopes(fit.v, fit.psi, fit.active)[1]
    white = np.linalg.solve(root, slopes)
    pull = np.concatenate([np.ones(len(fit.v)), np.full(len(fit.active), 1e-9)])
    at = np.concatenate([fit.v, fit.psi[list(fit.active)]])
    normal = white.T @ white + np.diag(pull)
    step = np.linalg.solve(normal, white.T @ np.linalg.solve(root, gap) - pull * at)
    there = replace(fit, residual=gap - slopes @ step, slopes=slopes, root=root)
    rest = tuple(k for k in surrogate.design.candidates if k not in fit.active)
    left = residual_test(
        local,
        there,
        Scores.of(local, there, rest),
        replicates=rules.replicates_after,
        refits=rules.refits // 4,
        seed=seed + 2,
    )
    covariance = np.linalg.inv(normal)
    strengths, intervals = [], []
    for i, k in enumerate(fit.active):
        j = len(fit.v) + i
        low = surrogate.design.effects[k].low
        sd = float(np.sqrt(covariance[j, j]))
        middle, ends = _cut_normal(float(at[j] + step[j]), sd, low, 1.0, rules.level)
        strengths.append(middle)
        intervals.append(ends)
    return Recentred(
        residual_test=left,
        v=at[: len(fit.v)] + step[: len(fit.v)],
        strengths=np.array(strengths),
        intervals=np.array(intervals).reshape(len(fit.active), 2),
        step=float(np.sqrt(step @ normal @ step)),
    )


def misfit(
    surrogate: Surrogate,
    fit: Fit,
    measured: Sequence[ConditionPours],
    fresh: Sequence[ConditionPours],
) -> float:
    """Returns r^T S^-1 r of measured and fresh pours, S at a fit."""
    _, root, gap = gap_of(surrogate, fit, measured, fresh)
    return float(np.sum(np.linalg.solve(root, gap) ** 2))


def gap_of(
    surrogate: Surrogate,
    fit: Fit,
    measured: Sequence[ConditionPours],
    fresh: Sequence[ConditionPours],
) -> tuple[LinearisedSurrogate, Array, Array]:
    """Returns the surrogate without its error, the root of S, and r."""
    seen, poured = StackedMeans.of(surrogate, measured), StackedMeans.of(surrogate, fresh)
    counts = seen.counts * poured.counts / (seen.counts + poured.counts)
    local = _without_error(
        LinearisedSurrogate.at(surrogate, seen.conditions, counts, fit.v, seen.sessions)
    )
    root = np.asarray(np.linalg.cholesky(local.covariance(fit.v, fit.psi)), dtype=np.float64)
    return local, root, (seen.means - poured.means).ravel()


def _without_error(local: LinearisedSurrogate) -> LinearisedSurrogate:
    """The surrogate's slopes and noise, its mean taken as known."""
    known = local.surrogate
    surrogate = replace(known, lack=np.zeros_like(known.lack), anchor=None)
    return replace(local, surrogate=surrogate, is_known=True)


def _cut_normal(
    mean: float, sd: float, low: float, high: float, level: float
) -> tuple[float, tuple[float, float]]:
    """Mean and central interval of a normal cut to [low, high]."""
    normal = NormalDist(mean, sd)
    below, above = normal.cdf(low), normal.cdf(high)
    if above - below < 1e-12:
        # All of it beyond one end.
        end = high if mean > high else low
        return end, (end, end)
    tail = (1 - level) / 2
    shares = (below + q * (above - below) for q in (tail, 1 - tail))
    ends = [normal.inv_cdf(min(max(share, 1e-15), 1 - 1e-15)) for share in shares]
    unit = NormalDist()
    a, b = (low - mean) / sd, (high - mean) / sd
    middle = mean + sd * (unit.pdf(a) - unit.pdf(b)) / (above - below)
    return middle, (ends[0], ends[1])
