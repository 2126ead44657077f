"""The loop on columns of beads at 4.6 g; the base model holds each test's liquid as it is known.

A liquid fills the beads up to their surface, drags them and is squeezed out between them, with the
density and the viscosity that are stated of the test. All tests are of one apparatus, so that
ground and tube are the same. Fitted are glycerols of 5, 52 and 157 mPa s; sealed are the one
between, water, and clay of 10 and 20 %, of other days but for the first.
"""

from pathlib import Path

import numpy as np

from granulcal.experiments._fronts import (
    DEFINITIONS,
    FILM,
    NUISANCES,
    TENSIONS,
    TORSION,
    close_fronts,
)
from granulcal.experiments.predictions.column_pours import UNKNOWN, column_scene, known_liquid
from granulcal.experiments.predictions.column_tests import Test, observing, read_tests
from granulcal.loop.effects.library import by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.pours.refine import ROUND
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.pours.pour_time import PourKind
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["reproduce", "task"]

_FOLDER = Path("column-collapse-webb")
# Seen by every camera of every test [s]; where the beads of thin liquids stop none has seen.
_TIMES = (0.05, 0.06, 0.07, 0.08, 0.09, 0.1, 0.12, 0.14, 0.16)
# A little later than the last of them [s].
_AFTER = 0.01
_ROUNDS = 1
_BUDGET = 1600 + _ROUNDS * ROUND
_EFFECTS = ("restitution.tangential", "restitution.speed")

_END = "_050_050_005"
# Name and tests of each condition: one liquid, one gravity.
_FITTED = (
    ("46 % glycerol", ("20210804_08g_050g",)),
    ("78 % glycerol", ("20220411_08g_500g",)),
    ("88 % glycerol", ("20220411_08g_1500g",)),
)
_SEALED = (
    ("85 % glycerol", ("20220411_08g_1000g",)),
    ("water", ("20211124_08g_010w",)),
    ("10 % clay", ("20211124_08g_010k", "20220413_08g_010k")),
    ("20 % clay", ("20211126_08g_020k", "20220412_08g_020k")),
)


def task(data: Path) -> Task:
    """Returns what is asked of the measured columns."""
    tests = {test.code: test for test in read_tests(data / _FOLDER / "Experimental_Conditions.txt")}
    scene = _scene(tests[_FITTED[0][1][0] + _END])
    conditions = [
        Condition(
            name,
            known_liquid(tests[codes[0] + _END]),
            use,
            tuple(data / _FOLDER / "runout" / f"{code}{_END}.txt" for code in codes),
        )
        for use, group in ((FIT, _FITTED), (SEALED, _SEALED))
        for name, codes in group
    ]
    effects = (FILM, *TENSIONS, TORSION, *by_name(_EFFECTS))
    library = (*effects, *declared_nuisances(NUISANCES, scene))
    return Task(
        scene,
        Prior(UNKNOWN.parameters),
        tuple(conditions),
        library,
        # Density and viscosity of a liquid go together.
        between=False,
        sealed_in_archive=False,
        definitions=DEFINITIONS,
    )


def _scene(test: Test) -> Scene:
    """The scene of every test: only the liquid differs."""
    scene = column_scene(test, "saturated")
    begin = scene.get("observe.begin")
    seen = observing(scene, np.array(_TIMES), end=False)
    horizon = begin + _TIMES[-1] + _AFTER
    return seen.with_({"end.horizon": horizon, "walls.0.motion.end": horizon})


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data)
    return [PourKind("the archive", asked.at_first(), asked.prior, _BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop; report.html, verdict.json and fronts.png in `out`/loop_centrifuge.

    Returns whether the verdict stands.
    """
    return close_fronts(
        task(data),
        out / "loop_centrifuge",
        command=f"granulcal reproduce loop_centrifuge --out {out}",
        title="Columns of beads at 4.6 g with the liquid that they stand in",
        budget=_BUDGET,
        rounds=_ROUNDS,
    )
