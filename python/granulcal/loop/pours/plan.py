"""What an archive is of, and its rows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.engines.in_use import law_of_pours, version_of_pours
from granulcal.loop.effects.design import Design
from granulcal.loop.effects.library import LibraryEffect, fingerprint
from granulcal.loop.effects.tolerance import Tolerances
from granulcal.loop.pours.rows import Rows
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["ArchivePlan", "Pours"]

Array = NDArray[np.float64]

# Most base pours whose images are kept at hand for faults of the image, and their
# largest share of the base.
_IMAGES, _IMAGES_SHARE = 400, 0.25
# Share of an effect's pours whose images are kept at hand, to be read under the image's as well.
_CROSSED_SHARE = 0.2


@dataclass(frozen=True, kw_only=True)
class ArchivePlan:
    """What an archive is of.

    Attributes:
        scene: the base scene.
        prior: of the material.
        conditions: path and range of each condition input, q of them.
        library: the effects.
        base: pours of the plain model, those of `images` among them.
        each: pours of each effect.
        seed: of all of them.
        tolerances: of the statistics; they need no pours.
        places: numbers of each condition, where pours are at these alone; else empty.
    """

    scene: Scene
    prior: Prior
    conditions: tuple[tuple[str, float, float], ...]
    library: tuple[LibraryEffect, ...]
    base: int
    each: int
    seed: int = 0
    tolerances: Tolerances | None = None
    places: tuple[dict[str, float], ...] = ()

    def record(self) -> dict[str, object]:
        """Returns what another run must agree with to use the same archive.

        Sizes may grow, and the library at its end.
        """
        return {
            "version": version_of_pours(),
            "law": law_of_pours(self.scene),
            "scene": self.scene.to_toml(),
            "prior": self.prior.to_toml(),
            "conditions": [list(condition) for condition in self.conditions],
            "library": fingerprint(self.library),
            "effects": [effect.name for effect in self.library],
            "each_effect": [fingerprint((effect,)) for effect in self.library],
            "seed": self.seed,
            "places": list(self.places),
        }

    @property
    def design(self) -> Design:
        """The coordinates of the loop."""
        return Design(
            parameters=tuple(self.prior.names),
            conditions=tuple(path for path, _, _ in self.conditions),
            effects=(
                *(effect.design() for effect in self.library),
                *(self.tolerances.effects() if self.tolerances else ()),
            ),
        )

    @property
    def pours(self) -> int:
        """Pours of the whole archive."""
        own = [e for e in self.library if not e.is_free]
        return self.base + self.each * len(own)

    @property
    def images(self) -> int:
        """Base pours whose images are read again; none where no effect is one of the image."""
        if not any(effect.image for effect in self.library):
            return 0
        return min(_IMAGES, int(_IMAGES_SHARE * self.base))

    def is_crossed(self, effect: LibraryEffect) -> bool:
        """Whether some pours of an effect are read under those of the image as well."""
        is_candidate = effect.nuisance_sd is None and effect.held is None
        return self.images > 0 and is_candidate and not effect.is_free

    @property
    def images_each(self) -> int:
        """How many pours of such an effect are."""
        return int(_CROSSED_SHARE * self.each) if self.images else 0

    def unit(self, at: dict[str, float]) -> Array:
        """Returns the inputs of a condition that states the numbers `at` in [0, 1], shape (q,)."""
        return self.unit_condition(np.array([at[path] for path, _, _ in self.conditions]))

    def unit_condition(self, values: Array) -> Array:
        """Returns condition inputs (n, q) as unit coordinates."""
        low = np.array([low for _, low, _ in self.conditions])
        high = np.array([high for _, _, high in self.conditions])
        return (values - low) / (high - low)


@dataclass(frozen=True)
class Pours(Rows):
    """Rows of an archive.

    Attributes:
        names: of the statistics.
        left_out: pours that were not usable, by why.
    """

    names: tuple[str, ...]
    left_out: LeftOut
