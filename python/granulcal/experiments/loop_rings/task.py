"""What is asked of the rings: maps of neighbouring number are repeats under one unknown height.

The groups, what is fitted and what is sealed were chosen by number, before any residual: a ball
that falls further leaves a wider ring, the number looks like the order of heights, and a ring that
leaves the picture (28, 29, 31, 35) is not seen whole. Up to map 8 a rim is lower than one simulated
grain, and there is nothing to compare it with. Statistics are of what stands above the bed; what is
below it, the crater, is left to be told (`shape.py`).
"""

from pathlib import Path

from granulcal.experiments.kinect_mounds import FOLDER, READING
from granulcal.loop.effects.library import LibraryEffect, by_name
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["EFFECTS", "GROUPS", "task"]

_SCENE = Path(__file__).with_name("bed.toml")
# Numbers of the maps: fitted as repeats, and sealed, a condition each.
GROUPS = {
    "middle": ((13, 14, 16, 17), (11, 19)),
    "late": ((22, 23, 25), (20, 26)),
}

EFFECTS: tuple[LibraryEffect, ...] = by_name(["cohesion.dry", "drag", "tilt.x", "camera.scale"])
"""What sand may have that dry balls in a level tray have not; few, for a pour takes ten seconds.

Not polydispersity: a bed is of equal grains, and unequal ones of a ball began in each other.
"""


def task(data: Path, group: str) -> Task:
    """Returns what is asked of a group of maps; the height of the fall is unknown and its own."""
    prior = Prior(
        [
            Parameter(path="material.sliding_friction", distribution="uniform", low=0.1, high=1.0),
            Parameter(
                path="material.rolling_friction", distribution="log_uniform", low=1e-2, high=1.0
            ),
            Parameter(path="material.restitution", distribution="uniform", low=0.0, high=0.8),
            Parameter(path="start.height", distribution="log_uniform", low=0.1, high=2.0),
            # How loose the bed is: a fluidised one is as loose as sand can lie.
            Parameter(path="bed.spacing", distribution="uniform", low=4.8e-3, high=5.8e-3),
            Parameter(path="camera.blur", distribution="uniform", low=0.5, high=3.0),
        ]
    )
    fitted, sealed = GROUPS[group]
    conditions = (
        Condition(f"{group} rings", {}, FIT, _maps(data, fitted), reading=READING),
        *(
            Condition(f"ring {number}", {}, SEALED, _maps(data, (number,)), reading=READING)
            for number in sealed
        ),
    )
    return Task(Scene.load(_SCENE), prior, conditions, EFFECTS)


def _maps(data: Path, numbers: tuple[int, ...]) -> tuple[Path, ...]:
    return tuple(data / FOLDER / f"fluidized_{number}.npz" for number in numbers)
