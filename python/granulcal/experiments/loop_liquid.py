r"""The loop on columns of beads at every gravity, the liquid's front as second observable.

The base model holds each test's liquid, which flows by itself (`effects.liquid`): it drags the
beads, slips through them as Di Felice's drag has it, and runs out ahead of them. All tests are in
units of their free fall: a column at N g is one at 1 g whose time is $\sqrt N$ times as long, whose
viscosities are over $\sqrt N$ and whose tension is over N. So one archive and one set of numbers
are of bench and centrifuge, but for candidates that have a unit: those are in units of free fall as
well. Restitution that falls with speed is the bead's own at 1 m/s on the bench and at $\sqrt N$ m/s
at N g, and a candidate's tension T stands for N T there.

The first frame of a film is where the liquid has come out from under the tube, at 62 mm. So the
clock of a pour begins when its liquid is there, and no test has a clock of its own but for what is
misread of it.
"""

from collections.abc import Mapping
from math import sqrt
from pathlib import Path

import numpy as np

from granulcal.experiments._fronts import (
    FILM,
    NUISANCES,
    OUTLINES,
    TENSIONS,
    TORSION,
    close_fronts,
)
from granulcal.experiments.predictions.column_pours import UNKNOWN, column_scene, known_flow
from granulcal.experiments.predictions.column_tests import Test, observing, read_tests
from granulcal.loop.effects.definitions import Definition
from granulcal.loop.effects.library import by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.pours.refine import ROUND
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.pours.pour_time import PourKind
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["BUDGET", "FITTED", "OWN_ERRORS", "ROUNDS", "SEALED_TESTS", "reproduce", "task"]

_FOLDER = Path("column-collapse-webb")
_FPS = 240.0
# Seen of both fronts by every camera of every test, once the beads are out [s at 1 g].
_TIMES = (0.15, 0.175, 0.2, 0.225, 0.25, 0.275, 0.3)
# The tube's outer radius, where films begin [m].
_TUBE = 0.062
# A pour ends that long after the tube's begin and the last time: the liquid may take its time, too
# [s at 1 g].
_AFTER = 0.1
ROUNDS = 1
BUDGET = 1600 + ROUNDS * ROUND
_EFFECTS = ("liquid.permeability", "restitution.tangential", "restitution.speed")
_DEPTH, _CLOCK = "observe.liquid.depth", "observe.clock.liquid_at"
_THIN = {_DEPTH: 1e-3, _CLOCK: _TUBE}
_PRIOR = Prior(UNKNOWN.parameters)
OWN_ERRORS: Mapping[str, Mapping[str, float | bool]] = {
    # Two frames of a centrifuge's film, in place of a clock that is set by hand.
    "clock.offset": {"sd": 0.008, "shared": False},
    # Of the liquid on the plate, which nobody stated [rad].
    "effects.liquid.contact_angle": {"sd": 0.3, "shared": True},
}
DEFINITIONS = (
    *(Definition(one.name, {**one.at, **_THIN}, one.reading) for one in OUTLINES),
    Definition("a deeper front of the liquid", {**OUTLINES[0].at, **_THIN, _DEPTH: 2e-3}),
    Definition("a shallower front of the liquid", {**OUTLINES[0].at, **_THIN, _DEPTH: 5e-4}),
    Definition("a clock from 60 mm on", {**OUTLINES[0].at, **_THIN, _CLOCK: 0.060}),
    Definition("a clock from 64 mm on", {**OUTLINES[0].at, **_THIN, _CLOCK: 0.064}),
)

Tests = tuple[tuple[str, tuple[str, ...]], ...]
FITTED: Tests = (
    ("water, 1 g", ("20210420_08g_010w_050_050_001", "20210816_08g_010w_050_050_001")),
    ("7 % glycerol, 1 g", ("20210824_08g_012g_050_050_001",)),
    ("46 % glycerol, 4.6 g", ("20210804_08g_050g_050_050_005",)),
    ("88 % glycerol, 4.6 g", ("20220411_08g_1500g_050_050_005",)),
)
SEALED_TESTS: Tests = (
    ("73 % glycerol, 1 g", ("20220608_08g_310g_050_050_001",)),
    ("78 % glycerol, 4.6 g", ("20220411_08g_500g_050_050_005",)),
    ("85 % glycerol, 4.6 g", ("20220411_08g_1000g_050_050_005",)),
    ("water, 4.6 g", ("20210914_08g_010w_050_050_005", "20211124_08g_010w_050_050_005")),
    ("20 % clay, 1 g", ("20211126_08g_020k_050_050_001",)),
    ("10 % clay, 4.6 g", ("20211124_08g_010k_050_050_005", "20220413_08g_010k_050_050_005")),
    ("20 % clay, 4.6 g", ("20211126_08g_020k_050_050_005", "20220412_08g_020k_050_050_005")),
)
"""Name and tests of each condition: one liquid, one gravity."""


def task(
    data: Path,
    prior: Prior = _PRIOR,
    own_errors: Mapping[str, Mapping[str, float | bool]] = OWN_ERRORS,
) -> Task:
    """Returns what is asked of the measured columns.

    Args:
        data: measured data.
        prior: of what nobody measured.
        own_errors: declared tolerances beside those of every study of fronts.
    """
    tests = {test.code: test for test in read_tests(data / _FOLDER / "Experimental_Conditions.txt")}
    scene = _scene(tests[FITTED[0][1][0]])
    conditions = [
        Condition(
            name,
            at_one_g(tests[codes[0]]),
            use,
            tuple(data / _FOLDER / "runout" / f"{code}.txt" for code in codes),
            reading={"fps": _FPS / sqrt(tests[codes[0]].numbers["N"])},
        )
        for use, group in ((FIT, FITTED), (SEALED, SEALED_TESTS))
        for name, codes in group
    ]
    effects = (FILM, *TENSIONS, TORSION, *by_name(_EFFECTS))
    library = (*effects, *declared_nuisances({**NUISANCES, **own_errors}, scene))
    return Task(
        scene,
        prior,
        tuple(conditions),
        library,
        # Density, viscosity and tension of a liquid go together.
        between=False,
        sealed_in_archive=False,
        definitions=DEFINITIONS,
    )


def at_one_g(test: Test) -> dict[str, float]:
    """Returns what is known of a test's liquid, by path, in units of the test's free fall."""
    gravity = test.numbers["N"]
    powers = {
        "effects.liquid.viscosity": 0.5,
        "effects.lubrication.viscosity": 0.5,
        "effects.liquid.tension": 1.0,
    }
    known = known_flow(test)
    return {path: value / gravity ** powers.get(path, 0.0) for path, value in known.items()}


def _scene(test: Test) -> Scene:
    """The scene of every test, at one g: only the liquid differs."""
    scene = observing(column_scene(test, "slipping"), np.array(_TIMES), end=False)
    listed = ", ".join(repr(t) for t in _TIMES)
    liquid = f"\n[observe.liquid]\ntimes = [{listed}]\ndepth = {_THIN[_DEPTH]!r}\n"
    begin = scene.get("walls.0.motion.begin")
    horizon = begin + _TIMES[-1] + _AFTER
    return Scene.from_toml(scene.to_toml() + liquid).with_(
        {
            "observe.begin": begin,
            "end.horizon": horizon,
            "walls.0.motion.end": horizon,
            "observe.clock.depth": _THIN[_DEPTH],
            # Looked for.
            FILM.path: 0.0,
            "effects.liquid.permeability": 1.0,
        }
    )


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data)
    return [PourKind("the archive", asked.at_first(), asked.prior, BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop; report.html, verdict.json and fronts.png in `out`/loop_liquid.

    Returns whether the verdict stands.
    """
    return close_fronts(
        task(data),
        out / "loop_liquid",
        command=f"granulcal reproduce loop_liquid --out {out}",
        title="Columns of beads and the liquid that flows through them, at every gravity",
        budget=BUDGET,
        rounds=ROUNDS,
    )
