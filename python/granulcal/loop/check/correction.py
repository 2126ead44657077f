r"""What the correction without physics leaves of the misfit, beside what an effect leaves.

On the scale z of the surrogate's statistics, y measured and x simulated pours of the base model,

$$ D^2_\mathrm{before} = D^2(y, x), \qquad D^2_\mathrm{after} = D^2(y, x + \hat\delta(c)) $$

with $D^2$ of `distance.py` and $\hat\delta$ of `discrepancy.py`, which was fitted to the conditions
to fit alone.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.distance import noise_free_square
from granulcal.loop.test.trace import Trace

__all__ = ["Correction", "corrections"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Correction:
    """The correction under one condition.

    Attributes:
        label: of the condition.
        before: D^2 of the base model, scale of the surrogate.
        after: D^2 with the correction; None where it is refused.
        refused: why, else empty.
    """

    label: str
    before: float
    after: float | None
    refused: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return asdict(self)


def corrections(
    surrogate: Surrogate,
    found: Trace,
    conditions: Sequence[tuple[str, Array, Array, Array]],
    names: Sequence[str],
) -> tuple[Correction, ...]:
    """Returns what the correction does under each condition.

    Args:
        surrogate: of the archive.
        found: the trace whose base fit is corrected.
        conditions: label, unit coordinates (q,), measured and simulated pours (n, s) of each.
        names: statistics of the error.
    """
    discrepancy = Discrepancy.of(found.local, found.base_fit)
    chosen = [i for i, name in enumerate(surrogate.names) if name in names]
    ones = np.ones(len(chosen))
    results = []
    for label, at, measured, simulated in conditions:
        y, x = (surrogate.standardise(rows) @ surrogate.from_axes for rows in (measured, simulated))
        y, x = y[:, chosen], x[:, chosen]
        before = noise_free_square(y, x, ones)
        try:
            delta = discrepancy.predict(at)[0][chosen]
        except ObservationError as error:
            results.append(Correction(label, before, None, str(error)))
            continue
        results.append(Correction(label, before, noise_free_square(y, x + delta, ones)))
    return tuple(results)
