"""The loop on collapsing columns of beads that stand in a fluid; the base model is dry.

Fitted are the three tests of 8 mm beads at 1 g in water or 7 % glycerol; sealed are the thick
glycerol at 1 g and 4.6 g. Thin fluids at 4.6 g were not tracked to their end and are left out.
"""

from pathlib import Path

from granulcal.loop.close import close_loop
from granulcal.loop.library import by_name
from granulcal.loop.page import write_page
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.prior import Parameter, Prior
from granulcal.scene import Scene

__all__ = ["reproduce", "task"]

_SCENE = Path(__file__).with_suffix(".toml")
_RUNOUT = Path("column-collapse-webb") / "runout"
_STANDARD, _CENTRIFUGE = -9.81, -45.22
_BUDGET = 2600
_EFFECTS = (
    "cohesion.capillary",
    "cohesion.dry",
    "ground.restitution",
    "ground.sliding",
    "ground.rolling",
    "polydispersity",
    "restitution.speed",
    "restitution.tangential",
    "fluid.density",
    "fluid.viscosity",
    "fluid.saturated",
    "fluid.entrained",
    "ground.layer",
)
# Name, gravity, tests, density and viscosity of the fluid: of Experimental_Conditions.txt.
_FITTED = (
    ("water, 1 g", _STANDARD, ("20210420_08g_010w", "20210816_08g_010w")),
    ("7 % glycerol, 1 g", _STANDARD, ("20210824_08g_012g",)),
)
_SEALED = (
    ("73 % glycerol, 1 g", _STANDARD, "20220608_08g_310g_050_050_001", 1190.84, 3.236e-2),
    ("78 % glycerol, 4.6 g", _CENTRIFUGE, "20220411_08g_500g_050_050_005", 1203.84, 5.246e-2),
    ("85 % glycerol, 4.6 g", _CENTRIFUGE, "20220411_08g_1000g_050_050_005", 1219.7, 0.1053),
    ("88 % glycerol, 4.6 g", _CENTRIFUGE, "20220411_08g_1500g_050_050_005", 1227.5, 0.1568),
)


def task(data: Path) -> Task:
    """Returns what is asked of the measured columns."""
    prior = Prior(
        [
            Parameter(path="material.sliding_friction", distribution="uniform", low=0.05, high=0.8),
            Parameter(
                path="material.rolling_friction", distribution="log_uniform", low=5e-3, high=0.3
            ),
            Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.9),
            # Of the tube [m/s], which nobody measured.
            Parameter(
                path="walls.0.motion.velocity.2", distribution="log_uniform", low=0.25, high=3.0
            ),
        ]
    )
    fitted = [
        Condition(name, {"gravity.2": g}, FIT, _files(data, [f"{t}_050_050_001" for t in tests]))
        for name, g, tests in _FITTED
    ]
    # What the fluid is known to be, should a fluid be what is missing; those that are fitted say it
    # themselves.
    sealed = [
        Condition(
            name,
            {"gravity.2": g},
            SEALED,
            _files(data, [test]),
            known={"effects.fluid.density": density, "effects.fluid.viscosity": viscosity},
        )
        for name, g, test, density, viscosity in _SEALED
    ]
    conditions = (*fitted, *sealed)
    return Task(Scene.load(_SCENE), prior, conditions, by_name(_EFFECTS))


def _files(data: Path, tests: list[str]) -> tuple[Path, ...]:
    return tuple(data / _RUNOUT / f"{test}.txt" for test in tests)


def reproduce(out: Path, data: Path) -> None:
    """Runs the loop; report.html and verdict.json in `out`/loop_column."""
    folder = out / "loop_column"
    closed = close_loop(task(data), folder, budget=_BUDGET)
    write_page(
        closed,
        folder / "report.html",
        command=f"granulcal reproduce loop_column --out {out}",
        title="Columns of beads in water and glycerol, modelled dry",
    )
    print(folder / "report.html")
