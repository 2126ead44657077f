"""How long a pour takes on this machine, found within a bounded time."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from granulcal import _native
from granulcal.engines import engine_in_use
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior

if TYPE_CHECKING:
    from granulcal.engines import Engine

__all__ = ["PATIENCE_S", "PourKind", "PourTime", "in_the_middle", "pour_time"]

PATIENCE_S = 45.0
_SEED = 6_000_011


@dataclass(frozen=True)
class PourTime:
    """What a pour costs on this machine.

    Attributes:
        seconds: of one pour, the mean [s of a core; of another engine on the clock].
        poured: pours that it is the mean of.
        cut: of a pour that was stopped and is extrapolated, how far it came and its horizon [s].
    """

    seconds: float
    poured: int
    cut: tuple[float, float] | None = None

    def __str__(self) -> str:
        """Returns the time of a pour and what it is from."""
        if self.cut is not None:
            reached, horizon = self.cut
            return (
                f"{self.seconds:.2f} s of a core each (a rough guess: a pour was stopped after "
                f"{reached:.3g} s of it, at whose pace it would go on until its horizon of "
                f"{horizon:g} s)"
            )
        pours = "1 pour" if self.poured == 1 else f"{self.poured} pours"
        return f"{self.seconds:.2f} s of a core each (mean of {pours})"


@dataclass(frozen=True)
class PourKind:
    """Pours of one kind that a study makes.

    Attributes:
        name: what they are for.
        scene: what is poured.
        prior: what is drawn.
        count: how many, at most.
    """

    name: str
    scene: Scene
    prior: Prior
    count: int


def pour_time(
    scenes: Sequence[Scene],
    *,
    seed: int = _SEED,
    engine: "Engine | None" = None,
    patience: float = PATIENCE_S,
) -> PourTime:
    """Pours scenes one after another, for about `patience` at most, and returns what one costs.

    The first is stopped when the time is up, and extrapolated; another one begins only where the
    time is enough for one as long as those before.

    Args:
        scenes: what is poured, at least one.
        seed: of the first pour; the next has the next one.
        engine: another simulator in place of ours, or of the one in use, whose pours cannot be
            stopped.
        patience: for all of them [s].
    """
    engine = engine or engine_in_use()
    begun, longest = time.monotonic(), 0.0
    took: list[float] = []
    for i, scene in enumerate(scenes):
        started = time.monotonic()
        left = patience - (started - begun)
        if took and left < longest:
            break
        if engine is not None:
            simulate(scene, seed=seed + i, engine=engine)
            # Nobody knows the processor's time of another engine.
            took.append(time.monotonic() - started)
        else:
            cost, reached, ended = _native.try_pour(scene.native, seed + i, max(left, 0.0))
            if not ended and not took:
                return PourTime(cost, 1, (reached, scene.get("end.horizon")))
            if ended:
                took.append(cost)
        longest = max(longest, time.monotonic() - started)
    return PourTime(math.fsum(took) / len(took), len(took))


def in_the_middle(scene: Scene, prior: Prior) -> Scene:
    """Returns the scene with every parameter at the median of its prior."""
    medians = {one.path: float(one.quantile(np.array([0.5]))[0]) for one in prior.free}
    return scene.with_({**prior.fixed, **medians})
