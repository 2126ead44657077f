r"""The evidence of a model by its own pours, with no error of the surrogate but that of its slopes.

With $\bar x$ the mean of pours of the model at $\hat w = (\hat v, \hat\psi)$, J and $\Delta$ as in
`recentre.py` and S the same for all models, that of pours of the base model,

$$ \log Z'_A = \log N(r - J \Delta; 0, S) + \log N(\hat v + \Delta_v; 0, I)
   + \frac{d}{2} \log 2 \pi - \frac12 \log |J^T S^{-1} J + \Lambda|
   + \log \frac{\int_{\mathrm{box}}}{|\mathrm{box}|}, \qquad r = \bar y - \bar x, $$

Laplace's method about the model where its pours put it; the strengths' normal is cut to their box.

Reference:
    Tierney and Kadane, Accurate approximations for posterior moments, JASA 81, 1986.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from granulcal.loop.check.recentre import gap_of
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.box import log_mass

__all__ = ["ByPours", "log_evidence"]


class ByPours(NamedTuple):
    """What a model's own pours say of it.

    Attributes:
        effects: of the model.
        log_probability: log Z' and the log of its prior share [nat], but for a constant.
        p: of what its pours leave.
    """

    effects: tuple[str, ...]
    log_probability: float
    p: float

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "effects": list(self.effects),
            "log_probability": self.log_probability,
            "p": self.p,
        }


def log_evidence(
    surrogate: Surrogate,
    base: Fit,
    fit: Fit,
    measured: Sequence[ConditionPours],
    fresh: Sequence[ConditionPours],
) -> float:
    """Returns log Z' of a model by fresh pours [nat].

    Args:
        surrogate: whose slopes and noise are used.
        base: where S is taken, the same for all models.
        fit: of the model, where it was poured.
        measured: pours under the conditions to fit.
        fresh: pours of the model under the same conditions, in their order.
    """
    local, root, gap = gap_of(surrogate, base, measured, fresh)
    slopes = local.slopes(fit.v, fit.psi, fit.active)[1]
    white = np.linalg.solve(root, np.column_stack([slopes, gap]))
    along, left = white[:, :-1], white[:, -1]
    p, active = len(fit.v), list(fit.active)
    pull = np.concatenate([np.ones(p), np.full(len(active), 1e-9)])
    at = np.concatenate([fit.v, fit.psi[active]])
    normal = along.T @ along + np.diag(pull)
    step = np.linalg.solve(normal, along.T @ left - pull * at)
    rest, end = left - along @ step, at + step
    square = float(rest @ rest + end[:p] @ end[:p])
    # Constants of the data are the same for all models; those of v and of the integral are not.
    log_z = -0.5 * square - float(np.log(np.diag(root)).sum())
    log_z += 0.5 * (len(end) - p) * float(np.log(2 * np.pi))
    log_z -= 0.5 * float(np.linalg.slogdet(normal)[1])
    if active:
        low = np.array([surrogate.design.effects[k].low for k in active])
        covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)[p:, p:]
        log_z += log_mass(end[p:], covariance, low) - float(np.log(1 - low).sum())
    return log_z
