"""What is asked of the rings: maps of neighbouring number are repeats under one unknown height.

The groups, what is fitted and what is sealed were chosen by number, before any residual: a ball
that falls further leaves a wider ring, the number looks like the order of heights, and a ring that
leaves the picture (28, 29, 31, 35) is not seen whole. Up to map 8 a rim is lower than one simulated
grain, and there is nothing to compare it with.
"""

from pathlib import Path

from granulcal.loop.effects.library import LibraryEffect, by_name
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["EFFECTS", "GROUPS", "task"]

_SCENE = Path(__file__).with_name("ball.toml")
_FOLDER = Path("granular-impact-kinect") / "data"
# Kinect maps have dead pixels along their edges.
_READING = {"border_px": 6, "height_threshold": 1e-3}
# Numbers of the maps: fitted as repeats, and sealed, a condition each.
GROUPS = {
    "middle": ((13, 14, 16, 17), (11, 19)),
    "late": ((22, 23, 25), (20, 26)),
}

EFFECTS: tuple[LibraryEffect, ...] = (
    *by_name(
        [
            "cohesion.capillary",
            "cohesion.dry",
            "ground.restitution",
            "ground.sliding",
            "ground.rolling",
            "restitution.speed",
            "drag",
            "tilt.x",
            "vibration",
            "diameter",
            "restitution.tangential",
            "camera.scale",
        ]
    ),
    LibraryEffect(
        name="count.fewer",
        family="count",
        path="grains.count",
        full=0.2,
        relative=True,
        whole=True,
        doc="less sand on the ground than the ball has",
    ),
    LibraryEffect(
        name="count.more",
        family="count",
        path="grains.count",
        full=2.5,
        relative=True,
        whole=True,
        doc="more sand than the ball has, as if the bed gave some",
    ),
    *by_name(["ground.layer"]),
)
"""The library of a dry ball on a plane, more or less sand, and a soft layer for the bed.

Not polydispersity: the ball begins as a lattice in which unequal grains overlap.
"""


def task(data: Path, group: str) -> Task:
    """Returns what is asked of a group of maps; the height is unknown and its own."""
    prior = Prior(
        [
            Parameter(path="material.sliding_friction", distribution="uniform", low=0.05, high=1.0),
            Parameter(
                path="material.rolling_friction", distribution="log_uniform", low=1e-2, high=1.0
            ),
            Parameter(path="material.restitution", distribution="uniform", low=0.0, high=0.9),
            Parameter(path="start.height", distribution="log_uniform", low=0.01, high=0.6),
            Parameter(path="camera.blur", distribution="uniform", low=0.5, high=3.0),
        ]
    )
    fitted, sealed = GROUPS[group]
    conditions = (
        Condition(f"{group} rings", {}, FIT, _maps(data, fitted), reading=_READING),
        *(
            Condition(f"ring {number}", {}, SEALED, _maps(data, (number,)), reading=_READING)
            for number in sealed
        ),
    )
    return Task(Scene.load(_SCENE), prior, conditions, EFFECTS)


def _maps(data: Path, numbers: tuple[int, ...]) -> tuple[Path, ...]:
    return tuple(data / _FOLDER / f"fluidized_{number}.npz" for number in numbers)
