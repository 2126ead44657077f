"""The loop on a rotating drum of MCC spheres: one time-averaged picture at each of two speeds.

Fitted are both speeds; as a cross-check each is fitted alone with the other sealed, from the same
pours. What the model predicts at speeds that were not measured here is written down, too.
"""

from pathlib import Path

import numpy as np

from granulcal.loop.close import Closed, close_loop
from granulcal.loop.library import LibraryEffect, by_name
from granulcal.loop.page import write_page
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.prior import Parameter, Prior
from granulcal.scene import Scene

__all__ = ["ASKED", "EFFECTS", "at_speed", "reproduce", "task"]

_SCENE = Path(__file__).with_suffix(".toml")
_FOLDER = Path("granudrum-mcc")
# Width of the picture, which is the drum's inner diameter [m].
_WIDTH = 0.084
_BUDGET = 702
# Rounds a minute of the two pictures, and when the simulated mean begins and ends [s].
_SPEEDS = {15: (0.8, 1.1), 45: (0.5, 0.8)}
# Of solidsizer_mcc.csv above 0.6 mm; below are 7 % of the grains and 0.05 % of the volume.
_SPREAD = 0.078
# Which speeds are fitted; the others are sealed.
ASKED = {"both": (15, 45), "fit-15": (15,), "fit-45": (45,)}

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
    *by_name(["restitution.speed", "restitution.tangential"]),
    LibraryEffect(
        name="drag",
        path="effects.fluid.viscosity",
        full=1e-3,
        unit="Pa s",
        doc="drag of air at rest; grains twice as large fall as those of 1.2 mm at 7e-5",
    ),
    LibraryEffect(
        name="restitution",
        path="material.restitution",
        off=0.3,
        full=0.9,
        doc="impacts that are less damped than the authors state",
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
    LibraryEffect(
        name="fill",
        path="grains.count",
        full=1.2,
        relative=True,
        whole=True,
        doc="more grains in the drum than the authors simulate",
    ),
    LibraryEffect(
        name="mantle.sliding",
        path="walls.0.material.sliding_friction",
        off=1.0,
        full=0.1,
        is_ratio=True,
        doc="a mantle on which grains slip",
    ),
)
"""What the base model may lack; friction of the end walls is one of its unknowns."""


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
        for rpm, (begin, end) in _SPEEDS.items()
    )
    return Task(Scene.load(_SCENE), prior, conditions, EFFECTS, between=False)


def reproduce(out: Path, data: Path) -> None:
    """Runs the loop on both speeds and on each alone; a report of each in `out`/loop_drum."""
    folder = out / "loop_drum"
    closed: dict[str, Closed] = {}
    for name, fitted in ASKED.items():
        closed[name] = close_loop(
            task(data, fitted), folder / name, archive=folder / "archive", budget=_BUDGET
        )
        write_page(
            closed[name],
            folder / name / "report.html",
            command=f"granulcal reproduce loop_drum --out {out}",
            title=f"MCC spheres in a drum, fitted at {' and '.join(map(str, fitted))} rpm",
        )
        print(folder / name / "report.html")
