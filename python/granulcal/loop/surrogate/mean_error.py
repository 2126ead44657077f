r"""The error of the surrogate's mean around one theta, as a function of strengths.

The mean is linear in its features, so that the root of its covariance is

$$ E(\psi) = E_0 + \sum_k \Bigl( \psi_k E_k + \psi_k^2 E_{kk}
   + \sum_j \frac{\sin \pi j \psi_k}{j} E_{kj} \Bigr) + \sum_{k < l} \psi_k \psi_l E_{kl} $$

each part being its features times the roots of the posterior (`roots.py`). The parts of an effect
take tens of megabytes, and fits go from one effect to the next, or from pair to pair: parts are
made when a strength asks for them, and the last of them are kept.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.columns import (
    CURVES,
    crossed_columns,
    curve_columns,
    curve_width,
    fold_curve,
)
from granulcal.loop.surrogate.surrogate import Surrogate

__all__ = ["MeanError"]

Array = NDArray[np.float64]

# Parts that are kept: of two effects, and of both together; no model has more.
_KEPT = 3


@dataclass(frozen=True)
class MeanError:
    """Roots of the covariance of the mean under H conditions.

    Attributes:
        surrogate: the emulator.
        theta: the same under each condition, unit coordinates, shape (H, p).
        conditions: shape (H, q).
    """

    surrogate: Surrogate
    theta: Array
    conditions: Array
    _kept: dict[tuple[int, ...], Array] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    def root(self, psi: Array) -> Array:
        """Returns E at strengths (K,), shape (H, m, d)."""
        root = self._base
        for k in np.nonzero(psi)[0].tolist():
            root = root + np.tensordot(self._factors(k, psi[k]), self._parts_of(k), axes=1)
        for k, other in self.surrogate.crossed_of(psi[None]):
            root = root + psi[k] * psi[other] * self._parts_of(k, other)[0]
        return root

    def chord(self, k: int, low: float, high: float) -> Array:
        """Returns what a unit of effect k's strength does to E between two, shape (H, m, d)."""
        rise = (self._factors(k, high) - self._factors(k, low)) / (high - low)
        return self.surrogate.roots.times_all(np.tensordot(rise, self._of_effect(k), axes=1))

    @cached_property
    def _base(self) -> Array:
        none = np.zeros((len(self.theta), len(self.surrogate.design.effects)))
        features = self.surrogate.features(self.theta, self.conditions, none)
        return self.surrogate.roots.times_all(features)

    def _factors(self, k: int, strength: float) -> Array:
        """What the parts of effect k are multiplied by, shape (2 + f,)."""
        plain = np.array([strength, strength**2])
        kinds = dict(self.surrogate.curved)
        if k not in kinds:
            return plain
        return np.concatenate([plain, curve_columns(np.array(strength), kinds[k])])

    def _parts_of(self, *effects: int) -> Array:
        """Parts of one effect, or of two together, shape (any, H, m, d)."""
        # Put in again, as the last one.
        found = self._kept.pop(effects, None)
        if found is None:
            if len(self._kept) == _KEPT:
                del self._kept[next(iter(self._kept))]
            features = self._of_pair(*effects) if len(effects) == 2 else self._of_effect(*effects)
            flat = self.surrogate.roots.times_all(features.reshape(-1, features.shape[-1]))
            found = flat.reshape(*features.shape[:-1], *flat.shape[1:])
        self._kept[effects] = found
        return found

    def _of_effect(self, k: int) -> Array:
        """Features that psi_k, its square and f sines of it multiply, shape (2 + f, H, d)."""
        plain = np.stack(self.surrogate.effect_features(self.theta, self.conditions, k))
        kinds = dict(self.surrogate.curved)
        if k not in kinds:
            return plain
        u = np.column_stack([self.theta, self.conditions])
        sines = np.zeros((CURVES, *plain.shape[1:]))
        each = fold_curve(np.eye(curve_width(u.shape[1])), u, kinds[k])
        sines[:, :, self.surrogate.curve(k)] = each
        return np.concatenate([plain, sines])

    def _of_pair(self, k: int, other: int) -> Array:
        """Features that the product of two strengths multiplies, shape (1, H, d)."""
        features = np.zeros((1, len(self.theta), self.surrogate.roots.width))
        along = crossed_columns(self.conditions)
        features[0, :, self.surrogate.crossed_slice(k, other)] = along
        return features
