"""What is asked of the drum: scene, prior, conditions and candidates."""

from pathlib import Path

import numpy as np

from granulcal.loop.effects.definitions import Definition
from granulcal.loop.effects.library import LibraryEffect, by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.effects.resolution import Resolution
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["EFFECTS", "SPEEDS", "at_speed", "task"]

_SCENE = Path(__file__).with_name("drum.toml")
_FOLDER = Path("granudrum-mcc")
# Width of the picture, which is the drum's inner diameter [m].
_WIDTH = 0.084
# Rounds a minute of the two pictures, and when the simulated mean begins and ends [s].
SPEEDS = {15: (0.8, 1.1), 45: (0.5, 0.8)}
# Of solidsizer_mcc.csv above 0.6 mm; below are 7 % of the grains and 0.05 % of the volume.
_SPREAD = 0.078

EFFECTS: tuple[LibraryEffect, ...] = (
    LibraryEffect(
        name="cohesion.capillary",
        family="cohesion",
        path="effects.capillary.bond",
        also=(("effects.capillary.walls", 0.0),),
        doc="liquid bridges between grains; pull at touch over a grain's weight",
    ),
    LibraryEffect(
        name="cohesion.dry",
        family="cohesion",
        path="effects.adhesion.bond",
        doc="adhesion of touching grains, and of grains to walls; pull over a grain's weight",
    ),
    LibraryEffect(
        name="sizes",
        path="effects.polydispersity.cv",
        full=_SPREAD,
        # Room for the larger grains at the start.
        also=(
            ("start.spacing", 2.85e-3),
            ("start.radius", 0.0415),
            ("start.from.1", -9.6e-3),
            ("start.to.1", 9.6e-3),
        ),
        doc="standard deviation over mean of the diameters, 1: as measured without the fines",
    ),
    *by_name(["restitution.speed", "restitution.tangential"]),
    LibraryEffect(
        name="drag",
        path="effects.fluid.viscosity",
        full=1e-3,
        unit="Pa s",
        doc="drag of air at rest",
    ),
)
"""What the base model may lack; friction of the end walls is one of its unknowns."""

FILL = LibraryEffect(
    name="fill",
    path="grains.count",
    full=1.2,
    relative=True,
    whole=True,
    doc="more grains in the drum than the authors simulate",
)
"""The fill is free and no finding: the instrument's nominal one supports more than the authors'."""

RESOLUTION = Resolution(
    diameter=1.2e-3, coarse=3.4e-3, scales={"start.spacing": 1.0, "start.jitter": 1.0}
)
"""The real grains, and the second size of the archive."""

# Own errors of the pictures: their middle, their height and their turn; one sd.
_FRAME = {"frame.x": 3e-4, "frame.z": 3e-4, "frame.turn": 5e-3}
# Standard deviation of the fill, in grains over the authors' number.
_FILL_SD = 0.1
_LEVEL = "observe.surface.level"
_DEFINITIONS = (
    Definition("hidden half of the time", {_LEVEL: 0.5}),
    Definition("hidden 40 % of the time", {_LEVEL: 0.4}),
    Definition("hidden 60 % of the time", {_LEVEL: 0.6}),
)


def at_speed(rpm: float, begin: float, end: float) -> dict[str, float]:
    """Returns the numbers of the scene at `rpm` rounds a minute."""
    rate = rpm * 2.0 * np.pi / 60.0
    turns = {f"walls.{i}.motion.rate": float(rate) for i in (0, 1)}
    return {**turns, "observe.begin": begin, "end.horizon": end}


def task(data: Path, fitted: tuple[int, ...] = (15, 45)) -> Task:
    """Returns what is asked of the pictures, the speeds that are not `fitted` sealed."""
    prior = Prior(
        [
            Parameter(path="material.sliding_friction", distribution="uniform", low=0.1, high=1.0),
            Parameter(
                path="material.rolling_friction", distribution="log_uniform", low=1e-3, high=1.0
            ),
            Parameter(
                path="walls.1.material.sliding_friction", distribution="uniform", low=0.0, high=1.0
            ),
        ]
    )
    conditions = tuple(
        Condition(
            f"{rpm} rpm",
            at_speed(rpm, begin, end),
            FIT if rpm in fitted else SEALED,
            (data / _FOLDER / f"gd_nature_{rpm}rpm_averaged.bmp",),
            reading={"width": _WIDTH},
            averaged=True,
        )
        for rpm, (begin, end) in SPEEDS.items()
    )
    scene = Scene.load(_SCENE)
    library = (
        *EFFECTS,
        FILL.declared(_FILL_SD * scene.get("grains.count"), scene),
        *declared_nuisances(_FRAME, scene),
        RESOLUTION.effect(scene),
    )
    return Task(scene, prior, conditions, library, between=False, definitions=_DEFINITIONS)
