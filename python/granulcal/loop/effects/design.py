"""What an archive of pours varies: parameters, condition inputs and effects, in unit coordinates.

Coordinates of every file of `loop`:

- theta in [0, 1]^p by the distribution function of each parameter's prior, so that the prior is
  uniform there; v = Phi^-1(theta) are z-scores, in which the prior is N(0, I);
- condition in [0, 1]^q over its range;
- psi, the strength of an effect: 0 is the model without it, 1 the upper end of its prior; a
  two-sided effect has -1 as well.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import TrainingDataError

__all__ = ["Design", "Effect", "cube_from_normal", "normal_from_cube"]

Array = NDArray[np.float64]

# Beyond this many standard deviations a prior coordinate is held: u is 0 or 1 to 3e-5 there.
LARGEST_Z = 4.0


@dataclass(frozen=True)
class Effect:
    """One thing the base model may lack.

    Attributes:
        name: its name in every table.
        is_two_sided: whether strengths of both signs are possible.
        family: effects of one family are one finding ("cohesion"), whatever their form.
        nuisance_sd: for a declared tolerance the standard deviation of its strength; such an effect
            is a random effect of every fit and never a finding. None for a candidate.
        is_shared: for a nuisance, whether one value holds for all conditions (a camera's scale) or
            each condition has its own (the height of a funnel that is set each time).
        held: strength that every fit has, outside what was poured as well (a limit of the grains'
            size); neither fitted nor named, and linear. None otherwise.
    """

    name: str
    is_two_sided: bool = False
    family: str = ""
    nuisance_sd: float | None = None
    is_shared: bool = True
    held: float | None = None

    @property
    def low(self) -> float:
        """Lower end of the strength's prior."""
        return -1.0 if self.is_two_sided else 0.0


@dataclass(frozen=True)
class Design:
    """Names of everything that an archive varies.

    Attributes:
        parameters: names of theta, p of them.
        conditions: names of the condition inputs, q of them (none if all pours are alike).
        effects: K of them, nuisances included.
    """

    parameters: tuple[str, ...]
    conditions: tuple[str, ...]
    effects: tuple[Effect, ...]

    def __post_init__(self) -> None:
        """Checks that every name appears once and tolerances are positive.

        Raises:
            TrainingDataError: one does not.
        """
        names = [*self.parameters, *self.conditions, *(effect.name for effect in self.effects)]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise TrainingDataError(f"each name may appear once, repeated: {', '.join(repeated)}")
        if not self.parameters:
            raise TrainingDataError("a design needs at least one parameter, got none")
        for effect in self.effects:
            if effect.nuisance_sd is not None and not effect.nuisance_sd > 0:
                raise TrainingDataError(
                    f"nuisance_sd of {effect.name} must be positive, got {effect.nuisance_sd}"
                )

    @property
    def candidates(self) -> tuple[int, ...]:
        """Indices of the effects that may be named."""
        return tuple(
            k
            for k, effect in enumerate(self.effects)
            if effect.nuisance_sd is None and effect.held is None
        )

    @property
    def nuisances(self) -> tuple[int, ...]:
        """Indices of the declared tolerances."""
        return tuple(k for k, effect in enumerate(self.effects) if effect.nuisance_sd is not None)

    @property
    def bends(self) -> NDArray[np.bool_]:
        """Whether the square of each effect is learnt: of all that are not held, shape (K,)."""
        return np.array([effect.held is None for effect in self.effects], dtype=bool)

    def none(self) -> Array:
        """Returns strengths without any effect but those that are held, shape (K,)."""
        return np.array([effect.held or 0.0 for effect in self.effects], dtype=np.float64)

    def family(self, k: int) -> str:
        """Returns the family of effect `k`: its own name if it declares none."""
        return self.effects[k].family or self.effects[k].name

    def check(
        self, theta: ArrayLike, condition: ArrayLike, psi: ArrayLike
    ) -> tuple[Array, Array, Array]:
        """Returns the three as matrices of one row for each pour.

        Raises:
            TrainingDataError: a shape, or a value outside the unit coordinates.
        """
        count = len(np.asarray(theta))
        shapes = {
            "theta": (theta, len(self.parameters), 0.0, 1.0),
            "condition": (condition, len(self.conditions), 0.0, 1.0),
            "psi": (psi, len(self.effects), -1.0, 1.0),
        }
        found = []
        for name, (values, columns, low, high) in shapes.items():
            matrix = np.asarray(values, dtype=np.float64)
            if matrix.shape != (count, columns):
                raise TrainingDataError(
                    f"{name} must have shape ({count}, {columns}), got {matrix.shape}"
                )
            inside = (matrix >= low - 1e-9) & (matrix <= high + 1e-9)
            if not inside.all():
                worst = matrix[~inside][0]
                raise TrainingDataError(
                    f"{name} must be in unit coordinates [{low:g}, {high:g}], got {worst:g}"
                )
            found.append(matrix)
        return found[0], found[1], found[2]


def cube_from_normal(v: Array) -> Array:
    """Returns Phi(v), any shape."""
    flat = [0.5 * math.erfc(-x / math.sqrt(2)) for x in np.asarray(v).ravel()]
    return np.array(flat).reshape(np.shape(v))


def normal_from_cube(u: Array) -> Array:
    """Returns Phi^-1(u), held within `LARGEST_Z`, any shape."""
    edge = 0.5 * math.erfc(LARGEST_Z / math.sqrt(2))
    inverse = NormalDist().inv_cdf
    flat = [inverse(min(max(float(x), edge), 1 - edge)) for x in np.asarray(u).ravel()]
    return np.array(flat).reshape(np.shape(u))
