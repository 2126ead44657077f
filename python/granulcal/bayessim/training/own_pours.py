"""Whether pours are those that a model was trained on: it may be saved over another."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from granulcal.errors import TrainingDataError

if TYPE_CHECKING:
    from granulcal.bayessim.model import BayesSim
    from granulcal.pours.dataset import Dataset

__all__ = ["require_own_pours"]


def require_own_pours(model: "BayesSim", data: "Dataset", path: Path) -> None:
    """Refuses pours that a model cannot have been trained on, as those of the one before it.

    A model knows how many pours it was given, and the least and the largest of each statistic.

    Args:
        model: of the folder.
        data: read from `path` beside it.
        path: for the message.

    Raises:
        TrainingDataError: other statistics, another number of pours, or other ranges.
    """
    if tuple(data.x_names) == tuple(model.x_names) and len(data) == model.summary.pair_count:
        usable, own = data.x[data.is_usable], model.standardiser
        if len(usable) == 0:
            return
        ranges = (usable.min(axis=0), own.low), (usable.max(axis=0), own.high)
        if all(np.array_equal(found, trained) for found, trained in ranges):
            return
    raise TrainingDataError(
        f"{path} has other pours than the model beside it was trained on, as where one is saved "
        "over another: move it away, or train the model again"
    )
