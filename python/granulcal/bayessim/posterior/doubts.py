"""What a posterior warns of: an observation or a prior for which it says less than it seems to."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.bayessim.network.standardise import Standardiser

__all__ = [
    "FewEffectiveDraws",
    "MassOutsidePrior",
    "OutOfRange",
    "PoursDisagree",
    "doubts_of",
    "out_of_range",
]


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
class _Told:
    """What the extension found, in its words."""

    text: str = field(kw_only=True, default="", repr=False, compare=False)

    def __str__(self) -> str:
        """One line."""
        return self.text


@dataclass(frozen=True)
class MassOutsidePrior(_Told):
    """Nearly all mass of a pour's mixture lies outside the prior's bounds.

    Attributes:
        pour: index of the pour.
        mass_inside: share inside the bounds before truncation.
    """

    pour: int
    mass_inside: float


@dataclass(frozen=True)
class FewEffectiveDraws(_Told):
    """The weighted draws of the posterior are worth few independent ones.

    Attributes:
        effective_sample_size: independent draws that the weighted draws are worth.
        needed: number below which this is reported.
    """

    effective_sample_size: float
    needed: float


@dataclass(frozen=True)
class PoursDisagree(_Told):
    """One material explains the pours much worse than a material for each pour would.

    Attributes:
        log_evidence_ratio: log probability of the pours under one shared material less that under
            independent materials [nat].
        needed: ratio below which this is reported.
    """

    log_evidence_ratio: float
    needed: float


Doubt = OutOfRange | MassOutsidePrior | FewEffectiveDraws | PoursDisagree


def doubts_of(density: _native.Posterior) -> tuple[Doubt, ...]:
    """Returns what the extension warns of."""
    found: list[Doubt] = []
    for kind, numbers, text in density.warnings:
        first, second = numbers
        if kind == "mass_outside_prior":
            found.append(MassOutsidePrior(int(first), second, text=text))
        elif kind == "few_effective_draws":
            found.append(FewEffectiveDraws(first, second, text=text))
        else:
            found.append(PoursDisagree(first, second, text=text))
    return tuple(found)


def out_of_range(
    standardiser: Standardiser, observed: NDArray[np.float64], names: Sequence[str]
) -> tuple[OutOfRange, ...]:
    """Returns for each of the pours `observed` (k, s) what lies beyond the training data."""
    found = []
    low, high = standardiser.low, standardiser.high
    for pour, outside in enumerate(standardiser.is_outside(observed)):
        where = np.flatnonzero(outside).tolist()
        if where:
            found.append(
                OutOfRange(
                    pour,
                    tuple(names[i] for i in where),
                    tuple(float(observed[pour, i]) for i in where),
                    tuple((float(low[i]), float(high[i])) for i in where),
                )
            )
    return tuple(found)
