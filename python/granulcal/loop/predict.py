"""What the models of a closed loop say of a condition that was not measured."""

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from granulcal.cores import cores
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.models import Models
from granulcal.loop.report.prediction import Prediction

__all__ = ["predict"]


def predict(
    loop: str | os.PathLike[str],
    at: Mapping[str, float],
    model: str = "named",
    *,
    level: float = 0.9,
    pours: int = 20,
    threads: int | None = None,
) -> Prediction:
    """Returns what a model of a closed loop says of a condition that was not measured.

    What is poured is kept in `loop`/pours. A loop that was closed with another engine needs that in
    use, `with granulcal.engines.pouring_with(engine)`.

    Args:
        loop: folder that `close_loop` wrote, with its models.json.
        at: numbers of the condition by path, such as `{"funnel.height": 0.07}`; those that it
            leaves out are the scene's own.
        model: `named`, the verdict's, or the most probable candidate where it names none; `base`,
            without an effect; `corrected`, the base model and its own interpolated residual;
            `line` or `nearest`, of the measured means alone.
        level: of the interval, of one pour.
        pours: of a model that is simulated, at least 2.
        threads: pours at once, all cores by default.

    Raises:
        FileNotFoundError: there is no models.json.
        ObservationError: the file is damaged, an unknown model, too few pours, a condition that
            lacks an input or that a model without physics cannot tell, or another engine.
    """
    models = Models.load(loop)
    forward = Forward(Path(loop) / "pours", threads or cores())
    found = models.predict(model, at, forward, level=level, pours=pours)
    return replace(found, doubts=(*models.doubts(model, at), *found.doubts))
