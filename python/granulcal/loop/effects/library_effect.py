"""One entry of the library of effects: a number of the scene, off and at full strength."""

import hashlib
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import TrainingDataError
from granulcal.loop.effects.design import Effect
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter

__all__ = ["LibraryEffect", "described", "fingerprint"]

Array = NDArray[np.float64]

# Fields that archives of before do not have in their record.
_LATER = ("image", "series", "held")


@dataclass(frozen=True, kw_only=True)
class LibraryEffect:
    """One entry of the library.

    Attributes:
        name: in every table.
        family: effects of one family are one finding.
        path: the number of the scene.
        off: its value without the effect, in `unit`.
        full: its value at psi = 1.
        unit: of the number.
        doc: what it is, in a line.
        is_two_sided: whether psi reaches down to -1.
        is_ratio: psi scales the logarithm: value = off (full / off)^psi.
        whole: the number is whole: strengths are tried at a few values.
        relative: `off` is the scene's own number, `full` a multiple of it.
        also: other numbers of the scene wherever the effect is on, by path.
        camera: power p of `(1 + full psi)^(p length)` by which lengths scale: costs no pour.
        shift: the condition input `path` is not what was stated, by `full`: base pours, read anew.
        image: kind of a fault of the image (`image_faults.py`), in place of a number of the scene:
            base pours whose images are read anew.
        series: kind of a fault of what was read off a series or profile (`series_faults.py`): base
            pours, read anew.
        held: psi that every fit has, and that is neither fitted nor named; None otherwise.
        nuisance_sd: of a declared tolerance, in psi; None for a candidate.
        is_shared: of a tolerance: one value for all conditions.
    """

    name: str
    family: str = ""
    path: str = ""
    off: float = 0.0
    full: float = 1.0
    unit: str = "-"
    doc: str = ""
    is_two_sided: bool = False
    is_ratio: bool = False
    whole: bool = False
    relative: bool = False
    also: tuple[tuple[str, float], ...] = ()
    camera: bool = False
    shift: bool = False
    image: str = ""
    series: str = ""
    held: float | None = None
    nuisance_sd: float | None = None
    is_shared: bool = True

    @property
    def is_of_sight(self) -> bool:
        """Whether it is a fault of the measurement, and nothing that grains do."""
        return bool(self.image or self.camera or self.series)

    def at(self, scene: Scene) -> "LibraryEffect":
        """Returns the effect with the scene's own numbers put in for relative ones."""
        if not self.relative:
            return self
        off = scene.get(self.path)
        values = {**asdict(self), "off": off, "full": off * self.full, "relative": False}
        return LibraryEffect(**values)

    def value(self, psi: float) -> float:
        """Returns the number of the scene at strength `psi`."""
        if self.is_ratio:
            return self.off * (self.full / self.off) ** psi
        value = self.off + psi * (self.full - self.off)
        return float(round(value)) if self.whole else value

    def strength(self, value: Array) -> Array:
        """Returns psi at values (n,) of the number."""
        if self.is_ratio:
            return np.log(value / self.off) / math.log(self.full / self.off)
        return (value - self.off) / (self.full - self.off)

    def parameter(self) -> Parameter:
        """Returns the distribution of the number over the effect's strengths."""
        ends = sorted((self.value(-1.0 if self.is_two_sided else 0.0), self.value(1.0)))
        kind = "log_uniform" if self.is_ratio else "uniform"
        return Parameter(path=self.path, distribution=kind, low=ends[0], high=ends[1])

    def declared(self, sd: float, scene: Scene) -> "LibraryEffect":
        """Returns the effect as a tolerance: a random effect of every fit, and never a finding.

        A table's tilt or the grains' diameter is the same under all conditions; a condition's own
        number (a height) is set anew for each.

        Args:
            sd: standard deviation of the number, in its unit.
            scene: whose own number a relative effect starts from.

        Raises:
            TrainingDataError: `sd` is not positive, or beyond the effect's whole range.
        """
        if not (sd > 0 and math.isfinite(sd)):
            raise TrainingDataError(f"tolerance of {self.name} must be positive, got {sd}")
        own = self.at(scene)
        if own.is_ratio:
            psi = math.log1p(sd / own.off) / abs(math.log(own.full / own.off))
        else:
            psi = sd / abs(own.full - own.off)
        if psi > 1 + 1e-9:
            ratio = max(own.full / own.off, own.off / own.full) if own.is_ratio else 0.0
            most = own.off * (ratio - 1) if own.is_ratio else abs(own.full - own.off)
            raise TrainingDataError(
                f"tolerance of {self.name} must be at most {most:g} {self.unit}, the whole range "
                f"that the library has of it, got {sd:g}"
            )
        return replace(own, nuisance_sd=psi, is_shared=not own.shift)

    @property
    def is_free(self) -> bool:
        """Whether base pours show the effect, without pours of its own."""
        return self.camera or self.shift or bool(self.image or self.series)

    def faults(self, psi: float) -> dict[str, float]:
        """Returns faults of image or series at strength `psi`, by kind; none of another effect."""
        kind = self.image or self.series
        return {kind: self.value(psi)} if kind else {}

    def numbers(self, psi: float) -> dict[str, float]:
        """Returns the numbers of the scene at strength `psi`, by path; none of a free effect."""
        if self.is_free:
            return {}
        if self.held is not None:
            # Two sizes were poured, and no others.
            return dict(self.also) if psi == 1 else {}
        return {self.path: self.value(psi), **dict(self.also)}

    def design(self) -> Effect:
        """Returns the effect as the statistics of the loop know it."""
        return Effect(
            self.name,
            is_two_sided=self.is_two_sided,
            family=self.family,
            nuisance_sd=self.nuisance_sd,
            is_shared=self.is_shared,
            held=self.held,
        )


def fingerprint(library: Sequence[LibraryEffect]) -> str:
    """Returns a hash of everything that the library says."""
    text = json.dumps([described(effect) for effect in library], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def described(effect: LibraryEffect) -> dict[str, Any]:
    """Returns all that an entry says; fields that came later only where they say something."""
    return {k: v for k, v in asdict(effect).items() if k not in _LATER or v not in ("", None)}
