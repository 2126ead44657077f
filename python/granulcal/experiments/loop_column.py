"""The loop on collapsing columns of beads that stand in a fluid; the base model is dry.

Fitted are the three tests of 8 mm beads at 1 g in water or 7 % glycerol; sealed are the thick
glycerol at 1 g and 4.6 g. Thin fluids at 4.6 g were not tracked to their end and are left out.
"""

from pathlib import Path

from granulcal.experiments._fronts import DEFINITIONS, NUISANCES, TENSIONS, close_fronts
from granulcal.loop.effects.law import law_numbers
from granulcal.loop.effects.library import by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.pours.refine import ROUND
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.pours.pour_time import PourKind
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["reproduce", "task"]

_SCENE = Path(__file__).with_suffix(".toml")
_RUNOUT = Path("column-collapse-webb") / "runout"
_STANDARD, _CENTRIFUGE = -9.81, -45.22
# 660 pours of the archive; the others are where the fits are, and for the checks.
_ROUNDS = 1
_BUDGET = 900 + _ROUNDS * ROUND
# Free numbers of the contact law: two dimensions more are what the archive can bear.
_WANTED = ("touching_exponent", "softness")
# In this order, so that an archive that is cut short has the fluids.
_EFFECTS = (
    "ground.sliding",
    "fluid.saturated",
    "fluid.entrained",
    "fluid.density",
    "fluid.lubrication",
    "ground.rolling",
    "restitution.tangential",
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
    scene = Scene.load(_SCENE)
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
            *law_numbers(_known_law(scene), scene),
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
            known={
                "effects.fluid.density": density,
                "effects.fluid.viscosity": viscosity,
                "effects.lubrication.viscosity": viscosity,
            },
        )
        for name, g, test, density, viscosity in _SEALED
    ]
    conditions = (*fitted, *sealed)
    effects = (one for name in _EFFECTS for one in by_name([name]))
    library = (*TENSIONS, *effects, *declared_nuisances(NUISANCES, scene))
    return Task(
        scene,
        prior,
        conditions,
        library,
        # Every fit is at 1 g.
        between=False,
        sealed_in_archive=False,
        definitions=DEFINITIONS,
    )


def _known_law(scene: Scene) -> list[str]:
    """The wanted numbers of the contact law that this version has."""
    known = {one.path.rpartition(".")[2] for one in law_numbers(True, scene)}
    return [name for name in _WANTED if name in known]


def _files(data: Path, tests: list[str]) -> tuple[Path, ...]:
    return tuple(data / _RUNOUT / f"{test}.txt" for test in tests)


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data)
    return [PourKind("the archive", asked.at_first(), asked.prior, _BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop; report.html, verdict.json and fronts.png in `out`/loop_column.

    Returns whether the verdict stands.
    """
    return close_fronts(
        task(data),
        out / "loop_column",
        command=f"granulcal reproduce loop_column --out {out}",
        title="Columns of beads in water and glycerol, modelled dry",
        budget=_BUDGET,
        rounds=_ROUNDS,
    )
