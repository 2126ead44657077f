r"""How far a model is off where fronts were measured, as part of its interval elsewhere.

$$ h = 1.645 \sqrt{\bar{g^2} + s^2}, \qquad s = (\mathrm{high} - \mathrm{low}) / (2 \cdot 1.645) $$

g are the model's residuals at one time, in units of free fall, of all measured tests but those of
the test's own day, and s is the scatter of its pours at draws of the fit.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments.predictions.between_tests import Told
from granulcal.experiments.predictions.column_tests import Fronts, Test
from granulcal.experiments.predictions.interval import HALF_90

__all__ = ["ModelError"]

Array = NDArray[np.float64]


class ModelError:
    """Residuals of one model.

    Args:
        fronts: of the measured tests.
        told: what the model says of each test, by its code.
    """

    def __init__(self, fronts: Fronts, told: Mapping[str, Told]) -> None:
        """Takes the residuals of the tests that were measured and told."""
        rows = [(t, r) for t, r in zip(fronts.tests, fronts.radius, strict=True) if t.code in told]
        self._tests = [test for test, _ in rows]
        self._gaps = np.array([radius - told[test.code].middle for test, radius in rows])

    def widened(self, test: Test, told: Told) -> Told:
        """Returns what is told of a test with the model's error in its interval."""
        square = ((told.high - told.low) / (2 * HALF_90)) ** 2
        others = np.array([t.campaign != test.campaign for t in self._tests], dtype=bool)
        if others.any():
            gaps = self._gaps[others]
            seen = np.isfinite(gaps)
            # A time at which no front was seen has the error of the nearest before it that was.
            each = np.sum(np.where(seen, gaps, 0.0) ** 2, axis=0) / np.maximum(seen.sum(axis=0), 1)
            known = np.flatnonzero(seen.any(axis=0))
            if len(known):
                place = np.searchsorted(known, np.arange(len(each)), side="right") - 1
                square = square + each[known[np.maximum(place, 0)]]
        half = HALF_90 * np.sqrt(square)
        return Told(told.middle, told.middle - half, told.middle + half)

    def held(self, told: Mapping[str, Told]) -> tuple[float, float]:
        """Returns rms residual [mm] and the share in the widened intervals; NaN without any."""
        if not len(self._gaps):
            return float("nan"), float("nan")
        half = np.array(
            [self.widened(t, told[t.code]).high - told[t.code].middle for t in self._tests]
        )
        seen = np.isfinite(self._gaps)
        inside = np.abs(self._gaps[seen]) <= half[seen]
        return float(np.sqrt(np.mean(self._gaps[seen] ** 2))), float(np.mean(inside))
