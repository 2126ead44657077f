r"""Whether the surrogate is right where a verdict stands: fresh pours of the model at its own fit.

With the mean $\bar y$ of fresh pours of the model under the conditions to fit,

$$ Q = (\bar y - m(\hat v, \hat\psi))^T V^{-1} (\bar y - m(\hat v, \hat\psi)) \sim \chi^2_{Hm} $$

where V has the noise of the fresh pours and the surrogate's own error. A small p says that the fit
rests on a place where the surrogate is wrong by more than it knows.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate

__all__ = ["confirm"]

Array = NDArray[np.float64]

_DRAWS = 4000


def confirm(surrogate: Surrogate, fit: Fit, fresh: Sequence[ConditionPours]) -> float:
    """Returns p of fresh pours of a model at its fit, from `_DRAWS` draws of chi squared."""
    stack = StackedMeans.of(surrogate, fresh)
    local = LinearisedSurrogate.at(surrogate, stack.conditions, stack.counts, fit.v)
    covariance = local.pour_covariance(fit.v, fit.psi) + local.error_covariance(fit.v, fit.psi)
    root = np.linalg.cholesky(covariance)
    white = np.linalg.solve(root, stack.means.ravel() - local.mean(fit.v, fit.psi))
    drawn = np.random.default_rng(0).chisquare(len(white), _DRAWS)
    return float((1 + np.sum(drawn >= white @ white)) / (1 + _DRAWS))
