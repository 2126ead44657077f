"""The library of effects that the loop looks for: each a number that the base model lacks.

An effect is a path of the scene, its value when off and its value at full strength, psi = 1. What
the simulator does with it, with equation and source, is in docs/theory/effects.md.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import TrainingDataError
from granulcal.loop.effects.design import Effect
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter

__all__ = ["FUNNEL", "LIBRARY", "LibraryEffect", "by_name", "described", "fingerprint"]

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
            TrainingDataError: `sd` is not positive.
        """
        if not (sd > 0 and math.isfinite(sd)):
            raise TrainingDataError(f"tolerance of {self.name} must be positive, got {sd}")
        own = self.at(scene)
        if own.is_ratio:
            psi = math.log1p(sd / own.off) / abs(math.log(own.full / own.off))
        else:
            psi = sd / abs(own.full - own.off)
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


FUNNEL: tuple[LibraryEffect, ...] = (
    LibraryEffect(
        name="cohesion.capillary",
        family="cohesion",
        path="effects.capillary.bond",
        full=3.0,
        also=(("effects.capillary.walls", 0.0),),
        doc="liquid bridges between grains; pull at touch over a grain's weight",
    ),
    LibraryEffect(
        name="cohesion.dry",
        family="cohesion",
        path="effects.adhesion.bond",
        full=3.0,
        also=(("effects.adhesion.walls", 0.0),),
        doc="adhesion of touching grains; pull over a grain's weight",
    ),
    LibraryEffect(
        name="ground.restitution",
        family="ground.restitution",
        path="effects.ground.restitution",
        off=1.0,
        full=0.0,
        doc="restitution at the ground over that between grains: a soft ground",
    ),
    LibraryEffect(
        name="ground.sliding",
        path="effects.ground.sliding_friction",
        off=1.0,
        full=0.25,
        is_two_sided=True,
        is_ratio=True,
        doc="sliding friction at the ground over that between grains",
    ),
    LibraryEffect(
        name="ground.rolling",
        path="effects.ground.rolling_friction",
        off=1.0,
        full=0.25,
        is_two_sided=True,
        is_ratio=True,
        doc="rolling friction at the ground over that between grains",
    ),
    LibraryEffect(
        name="polydispersity",
        path="effects.polydispersity.cv",
        full=0.22,
        doc="standard deviation over mean of the diameters",
    ),
    LibraryEffect(
        name="restitution.speed",
        path="effects.restitution_speed.exponent",
        full=0.3,
        doc="exponent q of e = e_0 v^-q",
    ),
    LibraryEffect(
        name="drag",
        path="effects.fluid.viscosity",
        full=8e-3,
        unit="Pa s",
        doc="Stokes' drag of a fluid at rest",
    ),
    LibraryEffect(
        name="tilt.x",
        family="tilt",
        path="effects.tilt.x",
        full=0.09,
        unit="rad",
        is_two_sided=True,
        doc="turn of the table about x",
    ),
    LibraryEffect(
        name="tilt.y",
        family="tilt",
        path="effects.tilt.y",
        full=0.09,
        unit="rad",
        is_two_sided=True,
        doc="turn of the table about y",
    ),
    LibraryEffect(
        name="vibration",
        path="effects.vibration.acceleration",
        full=1.5,
        unit="g",
        doc="shaking of the table after the pour",
    ),
    LibraryEffect(
        name="count",
        path="grains.count",
        full=0.75,
        relative=True,
        whole=True,
        is_two_sided=False,
        doc="fewer grains than stated",
    ),
    LibraryEffect(
        name="diameter",
        path="grains.diameter",
        full=0.9,
        relative=True,
        unit="m",
        is_two_sided=True,
        doc="grains of another diameter than stated",
    ),
    LibraryEffect(
        name="restitution.tangential",
        path="material.tangential_restitution",
        full=0.6,
        doc="part of the sliding velocity that a sticking impact turns back",
    ),
    LibraryEffect(
        name="height",
        path="funnel.height",
        shift=True,
        full=0.02,
        unit="m",
        is_two_sided=True,
        doc="the funnel hangs higher than stated",
    ),
    LibraryEffect(
        name="camera.scale",
        camera=True,
        full=0.01,
        is_two_sided=True,
        nuisance_sd=1.0,
        doc="lengths of the image are 1 % too large (a tolerance)",
    ),
    LibraryEffect(
        name="camera.offset",
        path="image.offset",
        image="offset",
        full=1e-3,
        unit="m",
        is_two_sided=True,
        doc="heights of grains are told from a plane that lies this much below their ground",
    ),
    LibraryEffect(
        name="camera.blur",
        path="image.blur",
        image="blur",
        full=3.0,
        unit="px",
        doc="the image is smoothed by a Gaussian of this standard deviation",
    ),
    LibraryEffect(
        name="camera.flying",
        path="image.flying",
        image="flying",
        full=0.5,
        doc="share of the pixels at depth edges that read a mixture of both sides",
    ),
    LibraryEffect(
        name="grains.lost",
        path="image.lost",
        image="lost",
        doc="share of the lone grains that the segmentation loses",
    ),
)
"""What a pour through a funnel may lack."""

LIBRARY: tuple[LibraryEffect, ...] = (
    *FUNNEL,
    LibraryEffect(
        name="fluid.density",
        family="fluid",
        path="effects.fluid.density",
        full=1500.0,
        unit="kg/m3",
        also=(("effects.fluid.viscosity", 1e-3),),
        doc="grains stand in a thin fluid: buoyancy, added mass, drag",
    ),
    LibraryEffect(
        name="fluid.viscosity",
        family="fluid",
        path="effects.fluid.viscosity",
        full=0.2,
        unit="Pa s",
        also=(("effects.fluid.density", 1000.0),),
        doc="grains stand in a thick fluid of the density of water",
    ),
    LibraryEffect(
        name="fluid.saturated",
        family="fluid",
        path="effects.fluid.density",
        full=1500.0,
        unit="kg/m3",
        also=(
            ("effects.fluid.viscosity", 1e-3),
            ("effects.fluid.saturated", 1.0),
            ("effects.fluid.crowding", 1.0),
            # Of the fluid between grains of a solid fraction of 0.6.
            ("effects.fluid.added_mass", 0.667),
        ),
        doc="a thin fluid fills the grains up to their own surface and goes with them",
    ),
    LibraryEffect(
        name="fluid.entrained",
        family="fluid",
        path="effects.fluid.density",
        full=1500.0,
        unit="kg/m3",
        also=(
            ("effects.fluid.viscosity", 1e-3),
            ("effects.fluid.entrained", 1.0),
            ("effects.fluid.crowding", 1.0),
        ),
        doc="grains stand in a thin fluid that goes with them where they are dense",
    ),
    LibraryEffect(
        name="fluid.lubrication",
        path="effects.lubrication.viscosity",
        full=0.2,
        unit="Pa s",
        doc="a fluid film resists surfaces that come together or part",
    ),
    LibraryEffect(
        name="ground.layer",
        path="effects.layer.thickness",
        full=2e-3,
        unit="m",
        doc="a soft layer on the ground, into which a grain sinks by a twentieth of its radius",
    ),
    LibraryEffect(
        name="rolling.form",
        path="effects.rolling_form.speed",
        full=0.05,
        unit="m/s",
        doc="rolling resistance grows with the speed of rolling up to this speed",
    ),
    LibraryEffect(
        name="funnel.x",
        family="funnel",
        path="effects.funnel.x",
        full=0.01,
        unit="m",
        is_two_sided=True,
        doc="the funnel hangs beside its place along x",
    ),
    LibraryEffect(
        name="funnel.lean",
        family="funnel",
        path="effects.funnel.lean_y",
        full=0.1,
        unit="rad",
        is_two_sided=True,
        doc="the funnel leans about y",
    ),
    LibraryEffect(
        name="funnel.friction",
        path="effects.funnel.sliding_friction",
        off=1.0,
        full=4.0,
        is_two_sided=True,
        is_ratio=True,
        doc="sliding friction at the funnel over that between grains",
    ),
    LibraryEffect(
        name="outlet",
        path="effects.outlet.aspect",
        off=1.0,
        full=1.3,
        doc="the outlet is an ellipse, long along x",
    ),
    LibraryEffect(
        name="clock.offset",
        family="clock",
        path="series.clock_offset",
        series="clock_offset",
        full=0.05,
        unit="s",
        is_two_sided=True,
        doc="the measured series began this much earlier than it says",
    ),
    LibraryEffect(
        name="clock.scale",
        family="clock",
        path="series.clock_scale",
        series="clock_scale",
        full=0.1,
        is_two_sided=True,
        doc="the measured clock is slow by this share",
    ),
    LibraryEffect(
        name="length.scale",
        path="series.length_scale",
        series="length_scale",
        full=0.05,
        is_two_sided=True,
        doc="measured lengths are too large by this share",
    ),
    LibraryEffect(
        name="frame.x",
        family="frame",
        path="series.frame_x",
        series="frame_x",
        full=2e-3,
        unit="m",
        is_two_sided=True,
        doc="the middle of the picture lies this far from that of the drum, along x",
    ),
    LibraryEffect(
        name="frame.z",
        family="frame",
        path="series.frame_z",
        series="frame_z",
        full=2e-3,
        unit="m",
        is_two_sided=True,
        doc="heights of the profile are too large by this",
    ),
    LibraryEffect(
        name="frame.turn",
        family="frame",
        path="series.frame_turn",
        series="frame_turn",
        full=0.05,
        unit="rad",
        is_two_sided=True,
        doc="the camera is turned about its axis, to a steeper slope",
    ),
    LibraryEffect(
        name="clump",
        path="effects.clump.aspect",
        off=1.0,
        full=1.8,
        doc="grains are two spheres grown together, longer than wide",
    ),
)
"""All that tasks may name."""


def by_name(
    names: Iterable[str], library: Sequence[LibraryEffect] = LIBRARY
) -> tuple[LibraryEffect, ...]:
    """Returns the named entries in the library's order.

    Raises:
        TrainingDataError: a name that the library does not have.
    """
    wanted = list(names)
    known = [effect.name for effect in library]
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise TrainingDataError(f"no effect {', '.join(unknown)}; there are {', '.join(known)}")
    return tuple(effect for effect in library if effect.name in wanted)


def fingerprint(library: Sequence[LibraryEffect]) -> str:
    """Returns a hash of everything that the library says."""
    text = json.dumps([described(effect) for effect in library], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def described(effect: LibraryEffect) -> dict[str, Any]:
    """Returns all that an entry says; fields that came later only where they say something."""
    return {k: v for k, v in asdict(effect).items() if k not in _LATER or v not in ("", None)}
