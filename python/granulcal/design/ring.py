"""A wanted ring, by two percentiles of the grains' distance from its centre."""

from dataclasses import dataclass

import numpy as np

from granulcal.real import check_real

__all__ = ["PERCENTILES", "STATISTICS", "Ring"]

PERCENTILES: tuple[float, float] = (5.0, 50.0)
"""Percentiles of the distance from the axis that stand for the inner and the outer radius [%]."""
STATISTICS: tuple[str, ...] = tuple(f"radius[{p:g}]" for p in PERCENTILES)
"""Names of the two statistics in a data set."""

_WIDEST = 10.0
"""Outer radius beyond which a number is taken for millimetres [m]."""


@dataclass(frozen=True)
class Ring:
    """A formation about an axis: a ring, or a pile.

    Attributes:
        outer: radius within which half of the grains lie [m].
        inner: radius within which one in twenty lies [m]; None: whatever goes with `outer`, as for
            a pile, whose inner radius nobody asks for.

    Reference:
        Matl et al., Inferring the material properties of granular media for robotic tasks, ICRA
        2020, section 'Robotic demonstrations': the 5th and 50th percentile of radial distance.

    Examples:
        >>> Ring(outer=0.073, inner=0.040)
        Ring(outer=0.073, inner=0.04)
    """

    outer: float
    inner: float | None = None

    def __post_init__(self) -> None:
        """Checks that the radii can be those of a ring."""
        check_real("outer", self.outer)
        if self.inner is not None:
            check_real("inner", self.inner)
        # A number in millimetres is refused before hundreds of pours, not after them.
        if not (np.isfinite(self.outer) and 0 < self.outer <= _WIDEST):
            raise ValueError(
                f"outer must be a positive radius [m] of at most {_WIDEST:g}, got {self.outer}"
            )
        if self.inner is not None and not 0 < self.inner < self.outer:
            raise ValueError(
                f"inner must lie between 0 and outer = {self.outer} m, got {self.inner}"
            )

    def __str__(self) -> str:
        """In words, lengths in centimetres."""
        if self.inner is None:
            return f"pile of outer radius {100 * self.outer:.2f} cm"
        return f"ring of inner radius {100 * self.inner:.2f} cm, outer {100 * self.outer:.2f} cm"
