r"""Grains that are larger than the real ones: two sizes in the archive, their limit in the model.

    [resolution]
    diameter = 1.2e-3                       # of the real grains [m]
    coarse = 2.4e-3                         # second size of the archive; the scene's is the first
    scales = { "start.spacing" = 1, "start.jitter" = 1 }   # further numbers, by their power of d

At equal solid volume N goes with $d^{-3}$, by itself where the scene states `grains.volume`. To
first order in d a mean pour has the error

$$ m(d) = m(d_\mathrm{true}) + (d - d_\mathrm{true}) m', $$

so with the scene's diameter d_1 and the coarse one d_2 the strength
$\psi = (d - d_1) / (d_2 - d_1)$ is 0 and 1 in the archive and

$$ \psi_\mathrm{true} = \frac{d_\mathrm{true} - d_1}{d_2 - d_1} < 0 $$

in every fit. It is held there: never fitted, never named. Its square is not learnt, for two sizes
cannot tell it. What the two sizes leave open about the slope grows with $\psi_\mathrm{true}^2$ and
is in the surrogate's error. Pours of a model are made at both sizes with the same seeds, and a mean
pour is $x_1 + \psi_\mathrm{true} (x_2 - x_1)$.

Reference:
    Richardson, The deferred approach to the limit, Phil. Trans. R. Soc. A 226, 1927 (order 1).
"""

from dataclasses import dataclass, field
from typing import Any

from granulcal.errors import ObservationError
from granulcal.loop.effects.library import LibraryEffect
from granulcal.pours.scene import Scene

__all__ = ["NAME", "Resolution"]

NAME = "resolution"
"""What the held effect is called."""

_DIAMETER, _COUNT, _VOLUME = "grains.diameter", "grains.count", "grains.volume"


@dataclass(frozen=True)
class Resolution:
    """Sizes of the grains.

    Attributes:
        diameter: of the real grains [m].
        coarse: of the second size of the archive [m].
        scales: further numbers that go with a power of the diameter, by path.
    """

    diameter: float
    coarse: float
    scales: dict[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, table: dict[str, Any]) -> "Resolution":
        """Returns the sizes in a table of a task file.

        Raises:
            ObservationError: a key that is missing or unknown.
        """
        needed = {"diameter", "coarse"}
        unknown, missing = set(table) - needed - {"scales"}, needed - set(table)
        if unknown or missing:
            what = f"has unknown {sorted(unknown)}" if unknown else f"lacks {sorted(missing)}"
            raise ObservationError(
                f"[resolution] {what}; it has diameter, coarse and may have scales"
            )
        scales = {path: float(power) for path, power in table.get("scales", {}).items()}
        return cls(float(table["diameter"]), float(table["coarse"]), scales)

    def held(self, scene: Scene) -> float:
        """Returns the strength of the real grains.

        Raises:
            ObservationError: sizes that are not real < scene < coarse.
        """
        own = scene.get(_DIAMETER)
        if not 0 < self.diameter < own < self.coarse:
            raise ObservationError(
                "[resolution] needs diameter < the scene's grains.diameter < coarse, got "
                f"{self.diameter:g}, {own:g} and {self.coarse:g}"
            )
        return (self.diameter - own) / (self.coarse - own)

    def numbers(self, scene: Scene) -> dict[str, float]:
        """Returns the numbers of the scene with coarse grains, by path."""
        ratio = self.coarse / scene.get(_DIAMETER)
        found = {path: scene.get(path) * ratio**power for path, power in self.scales.items()}
        if not scene.has(_VOLUME):
            found[_COUNT] = float(max(round(scene.get(_COUNT) / ratio**3), 1))
        return {_DIAMETER: self.coarse, **found}

    def effect(self, scene: Scene) -> LibraryEffect:
        """Returns the held effect: off at the scene's own size, full at the coarse one."""
        return LibraryEffect(
            name=NAME,
            path=_DIAMETER,
            off=scene.get(_DIAMETER),
            full=self.coarse,
            unit="m",
            doc="grains of the archive are larger than the real ones; held at the real size",
            also=tuple(sorted(self.numbers(scene).items())),
            held=self.held(scene),
        )
