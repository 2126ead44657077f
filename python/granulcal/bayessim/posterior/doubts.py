"""What a posterior warns of: an observation or a prior for which it says less than it seems to."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    pass

__all__ = ["FewEffectiveDraws", "MassOutsidePrior", "OutOfRange", "PoursDisagree"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OutOfRange:
    """Statistics of one pour lie beyond those of the training data: the model extrapolates.

    Attributes:
        pour: index of the pour.
        names: the statistics.
        values: what was observed, own units.
        ranges: lowest and highest training value of each, own units.
    """

    pour: int
    names: tuple[str, ...]
    values: tuple[float, ...]
    ranges: tuple[tuple[float, float], ...]

    def __str__(self) -> str:
        """One line that names each statistic with its value and its range."""
        parts = [
            f"{name} = {value:.4g} (trained on {low:.4g} .. {high:.4g})"
            for name, value, (low, high) in zip(self.names, self.values, self.ranges, strict=True)
        ]
        return f"pour {self.pour} is outside the training range: {', '.join(parts)}"


@dataclass(frozen=True)
class MassOutsidePrior:
    """Nearly all mass of a pour's mixture lies outside the prior's bounds.

    Attributes:
        pour: index of the pour.
        mass_inside: share inside the bounds before truncation.
    """

    pour: int
    mass_inside: float

    def __str__(self) -> str:
        """One line."""
        return f"pour {self.pour}: only {self.mass_inside:.2g} of the mass is inside the prior"


@dataclass(frozen=True)
class FewEffectiveDraws:
    """The pours' posteriors overlap so little that their product is poorly sampled.

    Attributes:
        effective_sample_size: independent draws that the weighted draws are worth.
        needed: number below which this is reported.
    """

    effective_sample_size: float
    needed: float

    def __str__(self) -> str:
        """One line."""
        return (
            f"the product of the pours is worth {self.effective_sample_size:.0f} draws only "
            f"(at least {self.needed:.0f} wanted): do these pours share one material?"
        )


@dataclass(frozen=True)
class PoursDisagree:
    """One material explains the pours much worse than a material for each pour would.

    Attributes:
        log_evidence_ratio: log probability of the pours under one shared material less that under
            independent materials [nat].
        needed: ratio below which this is reported.
    """

    log_evidence_ratio: float
    needed: float

    def __str__(self) -> str:
        """One line."""
        return (
            f"the pours contradict each other: log evidence of one material against several is "
            f"{self.log_evidence_ratio:.1f} (reported below {self.needed:.1f})"
        )
