r"""Columns of beads, dry or holding their liquid: what is known of a test, and its pours.

| model | liquid |
|---|---|
| `dry` | none |
| `saturated` | fills the beads to their surface, drags them, is squeezed out between them |
| `sheared` | the same, and resists surfaces that slide past each other |
| `slipping` | flows by itself, drags them and runs out ahead of them; films as `sheared` |

`slipping` tells tests of other days no better than `sheared`, and has no row in the predictions.

A test states gravity, beads and liquid, and all of them are taken as stated: density and viscosity
of `effects.fluid` (`effects.liquid` where it flows by itself) and `effects.lubrication` are the
test's own, as are the height up to which it fills the column, and its surface tension. What nobody
measured is left: friction of the beads and of the ground, restitution, and how fast the tube is
lifted (`UNKNOWN`).
Clay thins with shear, and its stated viscosity is that of the collapse as a whole, some hundreds a
second. In the films between beads, with thousands a second, it is taken as what is left at any
rate, that of hard grains in water, $\mu_w (1 + 2.5 C_v)$ (Einstein 1906).

Every time of a pour, its substep too, is in units of the test's free fall, $1 / \sqrt N$, so that a
pour at 28 g is as fine and as long as one at 1 g.
"""

from collections.abc import Sequence
from math import sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.cores import cores
from granulcal.experiments.predictions.column_tests import Test, observing, times_of
from granulcal.loop.pours.forward import Forward
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = [
    "LIQUIDS",
    "UNKNOWN",
    "ColumnPours",
    "column_scene",
    "known_flow",
    "known_liquid",
]

Array = NDArray[np.float64]

_SCENE = Path(__file__).parents[1] / "loop_column.toml"
UNKNOWN = Prior(
    [
        Parameter(path="material.sliding_friction", distribution="uniform", low=0.05, high=0.8),
        Parameter(path="material.rolling_friction", distribution="log_uniform", low=5e-3, high=0.3),
        Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.9),
        Parameter(path="walls.0.motion.velocity.2", distribution="log_uniform", low=0.1, high=3.0),
        Parameter(
            path="ground.material.sliding_friction", distribution="uniform", low=0.05, high=0.8
        ),
        Parameter(
            path="ground.material.rolling_friction", distribution="log_uniform", low=5e-3, high=0.3
        ),
    ]
)
"""Friction of beads and ground, restitution, the tube's speed [m/s]."""
_SATURATED = {
    "effects.fluid.crowding": 1.0,
    "effects.fluid.saturated": 1.0,
    # Of the fluid between grains of a solid fraction of 0.6.
    "effects.fluid.added_mass": 0.4 / 0.6,
}
_SHEARED = {"effects.lubrication.shear": 1.0}
_FLOWING = {
    "effects.liquid.radius": 0.054,
    # Of water on acrylic, some 70 degrees.
    "effects.liquid.contact_angle": 1.2,
    # Over theory's: what `reproduce loop_liquid` makes of it.
    "effects.liquid.permeability": 0.2,
}
LIQUIDS: dict[str, dict[str, float] | None] = {
    "sheared": {**_SATURATED, **_SHEARED},
    "saturated": _SATURATED,
    "dry": None,
}
"""Models by name: numbers of the scene beside the liquid's own; None without a liquid."""
_MODELS = {**LIQUIDS, "slipping": {**_FLOWING, **_SHEARED}}
# Times of the scene that go with free fall, and the one that is a rate.
_TIMES = ("substep", "walls.0.motion.begin", "observe.begin", "end.horizon")
_RATE = "observe.rate"
# Outer radius of the tube [m].
_TUBE = 0.062
_SEED = 8_700_001
_WATER = 1e-3


def column_scene(test: Test, model: str) -> Scene:
    """Returns a test's scene by a model, of which only `UNKNOWN` is not stated."""
    base, liquid = Scene.load(_SCENE), _MODELS[model]
    unit = 1.0 / sqrt(test.numbers["N"])
    numbers = test.scene_numbers(base)
    numbers |= {path: unit * base.get(path) for path in _TIMES}
    numbers |= {
        _RATE: base.get(_RATE) / unit,
        # The tube goes on for as long as anyone looks.
        "walls.0.motion.end": numbers["end.horizon"],
    }
    if liquid is not None:
        numbers |= {**(known_flow(test) if model == "slipping" else known_liquid(test)), **liquid}
        if model == "slipping":
            numbers["effects.liquid.begin"] = numbers["walls.0.motion.begin"]
    scene = observing(base, times_of(test)).with_(numbers)
    if model != "slipping":
        return scene
    # A film's first frame is where the liquid has come out from under the tube.
    return Scene.from_toml(f"{scene.to_toml()}\n[observe.clock]\nliquid_at = {_TUBE!r}\n")


def known_liquid(test: Test) -> dict[str, float]:
    """Returns density and viscosity of a test's liquid, in its films too, by path."""
    film = test.numbers["mu_f"]
    if test.fluid == "k":
        film = _WATER * (1.0 + 2.5 * test.numbers["C_v"])
    return {
        "effects.fluid.density": test.numbers["rho_f"],
        "effects.fluid.viscosity": test.numbers["mu_f"],
        "effects.lubrication.viscosity": film,
    }


def known_flow(test: Test) -> dict[str, float]:
    """Returns what is known of a test's liquid where it flows by itself, by path."""
    known = {
        path.replace("effects.fluid", "effects.liquid"): value
        for path, value in known_liquid(test).items()
    }
    return {
        **known,
        "effects.liquid.height": test.numbers["H_f0"],
        "effects.liquid.tension": test.numbers["sigma_f"],
    }


class ColumnPours:
    """Pours of tests.

    Args:
        pours: folder of the kept ones.
        model: one of `LIQUIDS`, or `slipping`.
    """

    def __init__(self, pours: Path, model: str) -> None:
        """Begins or goes on with a folder."""
        self._forward, self._model = Forward(pours, cores()), model

    def scene(self, test: Test) -> Scene:
        """Returns the test's scene, of which only `UNKNOWN` is not stated."""
        return column_scene(test, self._model)

    def fill(self, what: str, asked: Sequence[tuple[Test, Array, Sequence[int]]]) -> None:
        """Pours what `fronts` will be asked for, several at once; `what` names the steps."""
        self._forward.fill(what, [self._asked(*one) for one in asked])

    def fronts(self, test: Test, unknown: Array, seeds: Sequence[int]) -> Array:
        """Returns the fronts at the test's times and at the end [mm], shape (n, T + 1).

        Args:
            test: what is poured.
            unknown: values of `UNKNOWN`, shape (6,).
            seeds: of pours; those that are not usable have no row.
        """
        rows = 1e3 * self._forward.pours(*self._asked(test, unknown, seeds))
        # A body that has fallen apart is no front: the end is the farthest that was one.
        rows[:, -1] = np.fmax(rows[:, -1], np.nanmax(rows[:, :-1], axis=1))
        return np.asarray(rows, dtype=np.float64)

    def _asked(self, test: Test, unknown: Array, seeds: Sequence[int]) -> tuple[Scene, list[int]]:
        scene = self.scene(test).with_(dict(zip(UNKNOWN.names, unknown.tolist(), strict=True)))
        return scene, [_SEED + seed for seed in seeds]
