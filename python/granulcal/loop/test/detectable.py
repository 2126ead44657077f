r"""How strong an effect has to be for pours to show it, parameters refitted in full.

Data that are the surrogate's mean under a strength psi of effect k, without noise, are fitted
without effects. What is left of them stands $\Delta_k(\psi) = \sqrt{T_k}$ standard deviations out
(`score.py`), and the noise of the pours adds one, so that over materials and both signs

$$ \mathrm{power}_k(\psi) = \mathrm{mean}\; \Phi(\Delta_k(\psi) - z_{1 - .05 / K}), \qquad
   \mathrm{MDE}_k = \min \{ \psi : \mathrm{power}_k \ge .8 \; \text{from } \psi \text{ on} \} $$

with .05 / 2K for two-sided effects. Parameters that bend after an effect hide it at strengths at
which a linear fit would see it.
"""

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.baseline import Fit, improve
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.test.score import Scores

__all__ = ["STRENGTHS", "detectable", "distances"]

Array = NDArray[np.float64]

STRENGTHS = 2.0 ** np.arange(-4, 1)
"""Strengths that are refitted, in units of the prior's upper end; straight lines between them."""

_SEEN_IN, _ALARMS = 0.8, 0.05
# Between and beyond them, where an effect may be weak at its full strength.
_FINE = 2.0 ** np.arange(-10, 10, 1 / 16)


def distances(local: LinearisedSurrogate, fit: Fit, effects: tuple[int, ...]) -> Array:
    """Returns how far what is left of effects stands out at a fit, shape (K, 2, S).

    Of S strengths along either sign; along the one sign twice where an effect has no other.
    """
    design = local.surrogate.design
    found = np.empty((len(effects), 2, len(STRENGTHS)))
    for i, k in enumerate(effects):
        signs = (1.0, -1.0) if design.effects[k].is_two_sided else (1.0,)
        for side, sign in enumerate(signs):
            for at, strength in enumerate(sign * STRENGTHS):
                psi = fit.psi.copy()
                psi[k] = strength
                refit = improve(local, local.mean(fit.v, psi), fit.v, fit.psi, fit.active)
                scores = Scores.of(local, refit, (k,))
                left = (scores.whiten @ refit.residual)[:, None]
                found[i, side, at] = np.sqrt(scores.squares(left)[0, 0])
        found[i, len(signs) :] = found[i, 0]
    return found


def detectable(found: Array, is_two_sided: NDArray[np.bool_]) -> Array:
    """Returns the strengths from which on effects are seen in 80 %, shape (K,).

    Infinite where they are not at any strength.

    Args:
        found: distances of several materials, shape (M, K, 2, S).
        is_two_sided: of each effect, shape (K,).
    """
    from scipy.special import ndtr

    count = found.shape[1]
    seen = np.full(count, np.inf)
    for k in range(count):
        level = NormalDist().inv_cdf(1 - _ALARMS / (count * (2 if is_two_sided[k] else 1)))
        rows = found[:, k].reshape(-1, len(STRENGTHS))
        along = np.array([np.interp(_FINE, [0.0, *STRENGTHS], [0.0, *row]) for row in rows])
        # Beyond the last strength as from there on.
        along *= np.maximum(_FINE, 1.0)
        hidden = np.flatnonzero(ndtr(along - level).mean(axis=0) < _SEEN_IN)
        first = hidden[-1] + 1 if len(hidden) else 0
        if first < len(_FINE):
            seen[k] = _FINE[first]
    return seen
