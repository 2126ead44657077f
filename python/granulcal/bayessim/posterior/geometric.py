r"""Posterior by emulator and network together: the geometric average of both.

$$ p(u \mid x_1, \ldots, x_k) \propto p(u) \, L_k(u)^a \,
   \prod_i \Big(\frac{q(u \mid x_i)}{p(u)}\Big)^{b / k} $$

with the emulator's likelihood L of k pours of one material and the network's mixture q of each;
`average.py` finds a and b for one pour. The network's errors are the same for all pours, so that
all of them together count as one. It is a density known up to a factor like the emulator's own,
over the same points of the prior.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.average import Average
from granulcal.bayessim.posterior.importance import ImportanceDensity
from granulcal.bayessim.posterior.joint import density_over_prior
from granulcal.prior import Prior

__all__ = ["geometric_density"]

Array = NDArray[np.float64]

# A point whose weight is that much below another's cannot matter [nat].
_NEGLIGIBLE = 30.0


def geometric_density(
    prior: Prior,
    condition: tuple[Likelihood, Array],
    mixtures: Sequence[Mixture],
    average: Average,
) -> ImportanceDensity:
    """Returns the geometric average, normalised.

    Args:
        prior: the prior.
        condition: the emulated likelihood and the k pours, standardised, shape (k, s).
        mixtures: the network's of each pour, over coordinates.
        average: the exponents.
    """
    likelihood, z = condition

    def tilt(u: Array, emulated: Array, quick: bool) -> Array:
        learnt = np.mean([mixture.log_prob(u, quick=quick) for mixture in mixtures], axis=0)
        learnt -= prior.coordinate_log_prob(u)
        return average.emulator * emulated + average.network * learnt

    # Mixtures are dear, and nowhere above their bounds: points that cannot matter go without.
    pool, emulated = likelihood.pool, likelihood.start(z)
    highest = float(np.mean([mixture.log_bound() for mixture in mixtures]))
    at_most = highest - prior.coordinate_log_prob(pool)
    bound = average.emulator * emulated + average.network * at_most
    best = int(emulated.argmax())
    reached = tilt(pool[best : best + 1], emulated[best : best + 1], True)[0]
    matters = bound >= reached - _NEGLIGIBLE
    log_weights = np.full(len(pool), -np.inf)
    log_weights[matters] = tilt(pool[matters], emulated[matters], True)
    return density_over_prior(
        prior,
        lambda u, quick: tilt(u, likelihood.log_prob(z, u, quick=quick), quick),
        pool,
        log_weights,
        mixtures=tuple(mixtures),
    )
