"""Whether what is left is of one condition alone: its number, or its recordings, may be wrong.

A condition whose number is not what it was poured at leaves something as a missing effect does,
and an effect may do nearly the same. Left out, it takes all of it away; no other condition does.
"""

from collections.abc import Sequence

from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.base_test import base_test
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Trace

__all__ = ["of_alone"]

# Fewest conditions to fit: of two either has to be blamed for what the other does not show.
_LEAST = 3


def of_alone(
    surrogate: Surrogate, observed: Sequence[ConditionPours], found: Trace, rules: Thresholds
) -> tuple[str, ...]:
    """Returns what is to be said where one condition alone leaves something of the base model.

    Args:
        surrogate: of the archive.
        observed: pours under the conditions to fit.
        found: what it says of all of them.
        rules: from which p on nothing is left.
    """
    if found.residual_test.p > rules.name or len(observed) < _LEAST:
        return ()
    without = [
        base_test(
            surrogate,
            StackedMeans.of(surrogate, [other for other in observed if other is not one]),
            rules,
            found.seed,
        ).test.p
        for one in observed
    ]
    clean = [i for i, p in enumerate(without) if p > rules.detect]
    if len(clean) != 1:
        return ()
    (i,) = clean
    label = observed[i].label
    return (
        f"what is left is of {label} alone: without it nothing is (p = {without[i]:.2g}), without "
        "any other condition something is: are its numbers and its recordings what they are said "
        "to be? If they are, the effect shows under it alone",
    )
