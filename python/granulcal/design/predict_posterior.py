"""What an inferred material does under a condition that was not measured."""

import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from granulcal.cores import cores
from granulcal.design.posterior_file import PosteriorDraws
from granulcal.errors import ObservationError
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.measures import Measures
from granulcal.loop.recorded import doubt_of_start
from granulcal.loop.report.prediction import FEWEST, Prediction, require_level
from granulcal.pours.scene import Scene

__all__ = ["poured_scenes", "predict_posterior"]

# Seeds of pours, apart from those of training sets and of the loop.
_SEED = 8_700_001


def predict_posterior(
    posterior: PosteriorDraws,
    scene: Scene,
    at: Mapping[str, float],
    *,
    level: float = 0.9,
    pours: int = 20,
    threads: int | None = None,
) -> Prediction:
    """Returns statistics of pours at draws of a posterior, with intervals of one pour.

    Args:
        posterior: `PosteriorDraws.load(file)`, or `PosteriorDraws.of(posterior)`.
        scene: what it was inferred in.
        at: numbers of the condition by path, such as `{"funnel.height": 0.07}`.
        level: of the interval.
        pours: at as many draws, at least 2.
        threads: pours at once, all cores by default.

    Raises:
        ObservationError: no level, or too few pours or usable ones.
        ValueError: a draw or a number of the condition that the scene refuses.
    """
    require_level(level)
    if pours < FEWEST:
        raise ObservationError(f"pours must be at least {FEWEST}, got {pours}")
    scenes = poured_scenes(posterior, scene, at, pours)
    asked = [(each, [_SEED + i]) for i, each in enumerate(scenes)]
    with tempfile.TemporaryDirectory(prefix="granulcal-") as folder:
        forward = Forward(Path(folder), threads or cores())
        forward.fill("pours", asked)
        rows = np.concatenate([forward.pours(*one) for one in asked])
    names, of_start = Measures.of(scenes[0]).names, doubt_of_start("the condition", scenes[0])
    try:
        found = Prediction.of_pours("posterior", names, rows, level, asked=pours)
    except ObservationError as error:
        # Too few pours are seen: most often why.
        raise ObservationError("; ".join([str(error), *of_start])) from None
    return replace(found, doubts=(*_asked_for(posterior, at), *of_start, *found.doubts))


def poured_scenes(
    posterior: PosteriorDraws, scene: Scene, at: Mapping[str, float], pours: int
) -> list[Scene]:
    """Returns the scene at as many draws, under the condition.

    Raises:
        ValueError: a draw or a number of the condition that the scene refuses.
    """
    draws = posterior.samples[np.arange(pours) % len(posterior.samples)].tolist()
    # By itself first, so that a message names the condition's numbers alone.
    there = posterior.on(scene.with_(at))
    return [there.with_({**dict(zip(posterior.names, draw, strict=True)), **at}) for draw in draws]


def _asked_for(posterior: PosteriorDraws, at: Mapping[str, float]) -> list[str]:
    return [
        f"{path} = {at[path]:g} is what was asked for, no longer what was inferred or fixed"
        for path in at
        if path in (*posterior.names, *posterior.fixed)
    ]
