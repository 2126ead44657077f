"""Mean pours of several conditions, on the scale of the surrogate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop.surrogate.condition_pours import ConditionPours, session_numbers
from granulcal.loop.surrogate.surrogate import Surrogate

__all__ = ["StackedMeans"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StackedMeans:
    """Means of pours under H conditions.

    Attributes:
        labels: of the conditions.
        conditions: shape (H, q).
        means: standardised, transformed, shape (H, m).
        counts: pours of each, shape (H,).
        sessions: number of the session of each, shape (H,).
    """

    labels: tuple[str, ...]
    conditions: Array
    means: Array
    counts: Array
    sessions: NDArray[np.int64]

    @classmethod
    def of(cls, surrogate: Surrogate, observations: Sequence[ConditionPours]) -> "StackedMeans":
        """Returns the means of `observations`.

        Raises:
            ObservationError: none, another number of condition inputs, one outside the archive's
                range, or another number of statistics.
        """
        if not observations:
            raise ObservationError("at least one condition with pours is needed, got none")
        inputs = len(surrogate.design.conditions)
        for one in observations:
            if one.condition.shape != (inputs,):
                raise ObservationError(
                    f"{one.label}: the archive has {inputs} condition inputs, "
                    f"got {one.condition.size}"
                )
            if inputs and not (one.condition.min() >= -1e-6 and one.condition.max() <= 1 + 1e-6):
                raise ObservationError(
                    f"{one.label}: condition inputs must be within the archive's range [0, 1], "
                    f"got {one.condition.tolist()}"
                )
        return cls(
            labels=tuple(one.label for one in observations),
            conditions=np.array([one.condition for one in observations]).reshape(
                len(observations), inputs
            ),
            means=np.array([surrogate.standardise(o.pours).mean(axis=0) for o in observations]),
            counts=np.array([len(one.pours) for one in observations], dtype=np.float64),
            sessions=session_numbers([one.session for one in observations]),
        )
