r"""Posterior of one pour by emulator and network together: the geometric average of both.

$$ p(u \mid x) \propto p(u) \, L(u)^a \, \Big(\frac{q(u \mid x)}{p(u)}\Big)^b $$

with the emulator's likelihood L and the network's mixture q; `average.py` finds a and b. It is a
density known up to a factor like the emulator's own, over the same points of the prior.
"""

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.average import Average
from granulcal.bayessim.importance import ImportanceDensity
from granulcal.bayessim.likelihood import Likelihood, density_over_prior
from granulcal.bayessim.mixture import Mixture
from granulcal.prior import Prior

__all__ = ["geometric_density"]

Array = NDArray[np.float64]

# A point whose weight is that much below another's cannot matter [nat].
_NEGLIGIBLE = 30.0


def geometric_density(
    prior: Prior, condition: tuple[Likelihood, Array], mixture: Mixture, average: Average
) -> ImportanceDensity:
    """Returns the geometric average, normalised.

    Args:
        prior: the prior.
        condition: the emulated likelihood and the pour, standardised, shape (1, s).
        mixture: the network's, over coordinates.
        average: the exponents.
    """
    likelihood, z = condition

    def tilt(u: Array, emulated: Array, quick: bool) -> Array:
        learnt = mixture.log_prob(u, quick=quick) - prior.coordinate_log_prob(u)
        return average.emulator * emulated + average.network * learnt

    # The mixture is dear, and nowhere above its bound: points that cannot matter go without.
    pool, emulated = likelihood.pool, likelihood.start(z)
    at_most = mixture.log_bound() - prior.coordinate_log_prob(pool)
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
        mixtures=(mixture,),
    )
