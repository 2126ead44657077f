r"""How wide an interval of a strength has to be: simulated pairs of a truth and what is made of it.

Around the fit of a named effect strengths $\psi_b$ are drawn evenly and parameters from the normal
of the fit; each pair is poured as often as was measured, moved by one draw of the declared
nuisances (`own_errors.py`), and fitted as the measured pours were. Of its posterior $L_b(\psi)$ the
stretch

$$ \tau_b = \min \{ \tau \ge 1 : \psi_b \in I_\tau(L_b) \}, \qquad
   I_\tau(L) = \text{central interval of } L^{1 / \tau^2} $$

is what would have let the interval hold its truth. The interval of the measured pours is stretched
by the $\lceil 0.95 (B + 1) \rceil$-th smallest $\tau_b$, so that with pairs alike the measured set
it holds the truth in 95 % (split conformal prediction). It has in it whatever the posterior leaves
out, errors of the surrogate and bent ridges; not that another effect may be the right one.

Reference:
    Vovk, Gammerman and Shafer, Algorithmic learning in a random world, 2005, section 4.1.
    Lei et al., Distribution-free predictive inference for regression, JASA 113, 2018.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.check.own_errors import with_own_errors
from granulcal.loop.effects.design import LARGEST_Z, cube_from_normal, normal_from_cube
from granulcal.loop.surrogate.baseline import Fit, fit_base
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.refit import Model, fit_single, interval
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["FEWEST_PAIRS", "Coverage", "calibrate", "needed_stretch"]

Array = NDArray[np.float64]

FEWEST_PAIRS = 19
"""Fewest pairs from which an interval of 95 % can be read."""

# Tried stretches; beyond the largest the whole prior is the interval.
_STRETCHES = np.concatenate([np.arange(1.0, 4.0, 0.1), np.arange(4.0, 12.5, 0.5)])
# Strengths of pairs lie within the interval of the fit, widened by this.
_WIDER = 2.0


@dataclass(frozen=True)
class Coverage:
    """An interval that simulated pairs have widened.

    Attributes:
        effect: its index.
        interval: of the strength, shape (2,).
        stretch: tau.
        held: pairs whose plain interval held their truth.
        pairs: that were fitted.
        error: mean of what was found less the truth, over the pairs.
    """

    effect: int
    interval: Array
    stretch: float
    held: int
    pairs: int
    error: float

    @property
    def is_whole_range(self) -> bool:
        """Whether no stretch held as many pairs as asked: the interval is the whole range."""
        return not isfinite(self.stretch)

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "interval": self.interval.tolist(),
            # None: too few pairs, or none wide enough; the interval is the whole prior.
            "stretch": self.stretch if isfinite(self.stretch) else None,
            "plain_interval_held": self.held,
            "pairs": self.pairs,
            "mean_error": self.error,
        }


def needed_stretch(curve: Array, truth: float, level: float) -> float:
    """Returns the smallest stretch whose interval holds `truth`; infinite if none does."""
    for stretch in _STRETCHES:
        low, high = interval(curve, level, float(stretch))
        if low <= truth <= high:
            return float(stretch)
    return float("inf")


def calibrate(
    surrogate: Surrogate,
    model: Model,
    pour: Callable[[int, Array, float], list[ConditionPours] | None],
    thresholds: Thresholds,
    *,
    count: int,
    seed: int = 0,
) -> Coverage | None:
    """Returns the interval of a single effect's strength, widened until pairs cover.

    Args:
        surrogate: of the archive.
        model: of one effect, fitted to the measured pours.
        pour: pours of pair b, parameters (p,) in unit coordinates and strength, under the
            conditions to fit; None where too many were not usable.
        thresholds: of the fit.
        count: of pairs.
        seed: of the draws.

    Returns:
        None if no pair could be poured.
    """
    (k,) = model.effects
    level, low = thresholds.level, surrogate.design.effects[k].low
    generator = np.random.default_rng(seed)
    ends = np.clip(_widened(model.intervals[0]), low, 1.0)
    stretches, errors = [], []
    for b in range(count):
        psi = float(generator.uniform(*ends))
        theta = _draw(model.fit, psi, generator)
        observed = pour(b, theta, psi)
        if observed is None:
            continue
        own = np.random.default_rng([seed, b])
        observed = with_own_errors(surrogate, normal_from_cube(theta), observed, own)
        stack = StackedMeans.of(surrogate, observed)
        local, base = fit_base(surrogate, stack, seed + b)
        found = fit_single(local, stack.means.ravel(), base, k, thresholds)
        stretches.append(needed_stretch(found.curve, psi, level))
        errors.append(float(found.strengths[0]) - psi)
    if not stretches:
        return None
    rank = ceil(level * (len(stretches) + 1))
    stretch = float("inf") if rank > len(stretches) else sorted(stretches)[rank - 1]
    widened = (
        np.array([low, 1.0])
        if np.isinf(stretch)
        else np.array(interval(model.curve, level, stretch))
    )
    held = sum(s == 1.0 for s in stretches)
    return Coverage(k, widened, stretch, held, len(stretches), float(np.mean(errors)))


def _widened(ends: Array) -> Array:
    middle, half = ends.mean(), 0.5 * (ends[1] - ends[0])
    return middle + _WIDER * half * np.array([-1.0, 1.0])


def _draw(fit: Fit, psi: float, generator: np.random.Generator) -> Array:
    """Parameters in unit coordinates of the normal of the fit, given the strength."""
    p = len(fit.v)
    white = np.linalg.solve(fit.root, fit.slopes)
    normal = white.T @ white
    normal[:p, :p] += np.eye(p)
    own, across = normal[:p, :p], normal[:p, p:]
    shift = psi - fit.psi[list(fit.active)]
    centre = fit.v - np.linalg.solve(own, across @ shift)
    root = np.linalg.cholesky(np.linalg.inv(own))
    drawn = centre + root @ generator.standard_normal(p)
    return cube_from_normal(np.clip(drawn, -LARGEST_Z, LARGEST_Z))
