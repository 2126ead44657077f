"""The library of effects that the loop tests: each a number that the base model lacks.

An effect is a path of the scene, its value when off and its value at full strength, psi = 1. What
the simulator does with it, with equation and source, is in docs/theory/effects.md.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.documents import meant
from granulcal.errors import TrainingDataError
from granulcal.loop.effects.library_effect import LibraryEffect, described, fingerprint

__all__ = ["FUNNEL", "LIBRARY", "LibraryEffect", "by_name", "described", "fingerprint"]

Array = NDArray[np.float64]

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
    LibraryEffect(
        name="camera.missing",
        path="image.missing",
        image="missing",
        full=0.1,
        doc="share of the pixels that have no data, each by itself",
    ),
    LibraryEffect(
        name="camera.x",
        family="camera.aside",
        path="image.x",
        image="aside_x",
        full=0.01,
        unit="m",
        is_two_sided=True,
        doc="the camera stands this far beside the pour's axis, along x",
    ),
    LibraryEffect(
        name="camera.y",
        family="camera.aside",
        path="image.y",
        image="aside_y",
        full=0.01,
        unit="m",
        is_two_sided=True,
        doc="the camera stands this far beside the pour's axis, along y",
    ),
)
"""What a pour through a funnel may lack."""

LIBRARY: tuple[LibraryEffect, ...] = (
    *FUNNEL,
    # Of a fluid that is thin the inertia alone drags: where it weighs nothing, it does nothing.
    LibraryEffect(
        name="fluid.density",
        family="fluid",
        path="effects.fluid.density",
        full=1500.0,
        unit="kg/m3",
        doc="grains stand in a thin fluid: buoyancy, added mass, drag",
    ),
    LibraryEffect(
        name="fluid.viscosity",
        family="fluid",
        path="effects.fluid.viscosity",
        full=0.2,
        unit="Pa s",
        doc="grains stand in a thick fluid, of the scene's density: Stokes' drag",
    ),
    LibraryEffect(
        name="fluid.saturated",
        family="fluid",
        path="effects.fluid.density",
        full=1500.0,
        unit="kg/m3",
        also=(
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
        name="liquid.permeability",
        path="effects.liquid.permeability",
        off=1.0,
        full=10.0,
        is_two_sided=True,
        is_ratio=True,
        doc="grains let the scene's liquid through more or less easily than theory says",
    ),
    LibraryEffect(
        name="bonds",
        path="effects.bonds.bond",
        full=10.0,
        doc="bonds of the start's grains that break for good; pull over a grain's weight",
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
    # Not among the usual ones: what it does to one formation other grains do as well.
    LibraryEffect(
        name="camera.lens",
        path="image.lens",
        image="lens",
        full=0.1,
        is_two_sided=True,
        doc="the lens is longer than stated by this share: lengths across the view are too large",
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
        said = ", ".join(f"{name}{meant(name, known)}" for name in unknown)
        raise TrainingDataError(f"no effect {said}; there are {', '.join(known)}")
    return tuple(effect for effect in library if effect.name in wanted)
