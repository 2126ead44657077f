r"""Whether recordings of one condition differ from each other as pours do.

Every fit takes measured pours to scatter as simulated ones. With $\epsilon_{hi}$ the deviation of
recording i from the mean of its condition, on axes of uncorrelated noise and over the scale of a
pour at the fit,

$$ W = \sum_{h i} \lVert \epsilon_{hi} \rVert^2 $$

is ranked among that of as many residuals of archive rows near the fit that made no covariance, the
same that replicates of the residual test are made of. Recordings that differ by more have a noise
of their own, which passes for an effect; those that differ by less may be several of one pour, and
each was counted as a pour.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import NEAR
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["Scatter", "of_scatter", "scatter_of"]

Array = NDArray[np.float64]

_DRAWS = 2000
# What the surrogate cannot follow is in the draws as well: recordings differ by a little less.
_FEW = 0.7


class Scatter(NamedTuple):
    """How recordings differ from each other.

    Attributes:
        ratio: of their standard deviation to that of pours.
        more: p of scatter as large, were they pours of the model.
        less: p of scatter as small.
    """

    ratio: float
    more: float
    less: float


def scatter_of(
    surrogate: Surrogate, fit: Fit, measured: Sequence[ConditionPours], *, seed: int = 0
) -> Scatter | None:
    """Returns how the recordings of each condition differ; None where no condition has two.

    Args:
        surrogate: whose noise pours have.
        fit: where the noise is taken.
        measured: pours under the conditions to fit.
        seed: of the draws.
    """
    generator, theta = np.random.default_rng(seed), cube_from_normal(fit.v)
    seen, drawn = 0.0, np.zeros(_DRAWS)
    several = [one for one in measured if len(one.pours) > 1]
    for one in several:
        at = theta[None], one.condition[None], fit.psi[None]
        rows = surrogate.standardise(one.pours) / surrogate.scale(*at)
        near = surrogate.weights_near(theta, one.condition, NEAR) * surrogate.is_donor
        shape = _DRAWS, len(rows)
        chosen = generator.choice(len(near), size=shape, p=near / near.sum())
        seen += float(_squares(rows[None])[0])
        drawn += _squares(surrogate.noise[chosen])
    if not several:
        return None
    more, less = ((1 + np.sum(s * (drawn - seen) >= 0)) / (1 + _DRAWS) for s in (1.0, -1.0))
    return Scatter(float(np.sqrt(seen / drawn.mean())), float(more), float(less))


def of_scatter(found: Scatter | None, rules: Thresholds) -> tuple[str, ...]:
    """Returns what is to be said of recordings that do not differ as pours do."""
    if found is None:
        return ()
    least = rules.confirm / 2
    if found.more <= least:
        return (
            f"recordings of one condition differ from each other by {found.ratio:.2g} times what "
            f"pours of the model do (p = {found.more:.2g}): every fit takes them to scatter as "
            "pours do, so that what is left, and a name for it, may be no more than that",
        )
    if found.less > least or found.ratio > _FEW:
        return ()
    return (
        f"recordings of one condition differ from each other by {found.ratio:.2g} times what pours "
        f"of the model do (p = {found.less:.2g}): are several of them of one pour? Each counts as "
        "a pour of its own, and the noise of one pour passes for an effect",
    )


def _squares(rows: Array) -> Array:
    """Squared deviations from their mean of rows (b, n, m), summed, shape (b,)."""
    return np.sum((rows - rows.mean(axis=1, keepdims=True)) ** 2, axis=(1, 2))
