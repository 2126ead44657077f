"""What is asked of the drum: scene, prior, conditions and candidates."""

from pathlib import Path

import numpy as np

from granulcal.loop.effects.definitions import Definition
from granulcal.loop.effects.library import LibraryEffect
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
# Rounds a minute of the two pictures, and when the simulated mean begins and ends [s]: from 1.2 and
# 0.9 s on the surface stands, whatever is waited for longer (docs/results/loop-measured.md).
SPEEDS = {15: (1.5, 2.0), 45: (0.9, 1.2)}

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
)
"""What the base model may lack; friction of the end walls and the fill are among its unknowns.

The spread of sizes, both laws of restitution and drag are not among them: of an archive of before,
two pictures could not have shown the first three at any strength, and drag at the end of its range.
"""

RESOLUTION = Resolution(
    diameter=1.2e-3, coarse=2.4e-3, scales={"start.spacing": 1.0, "start.jitter": 1.0}
)
"""The real grains, and the second size of the archive."""

# Own errors of the pictures: their middle, their height and their turn; one sd.
_FRAME = {"frame.x": 3e-4, "frame.z": 3e-4, "frame.turn": 5e-3}
# Volume of the grains [m^3]: the authors' number of 1.2 mm, 9 % fewer to 21 % more.
_FILL = (2.4e-5, 3.2e-5)
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
            Parameter(path="grains.volume", distribution="uniform", low=_FILL[0], high=_FILL[1]),
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
        *declared_nuisances(_FRAME, scene),
        RESOLUTION.effect(scene),
    )
    return Task(scene, prior, conditions, library, between=False, definitions=_DEFINITIONS)
