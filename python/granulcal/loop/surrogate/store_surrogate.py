"""The surrogate of all pours of an archive, and of those that were made where the fits are."""

from collections.abc import Callable, Sequence

import numpy as np

from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.one_thread import one_thread

__all__ = ["fit_surrogate"]


@one_thread()
def fit_surrogate(
    store: Archive,
    *,
    seed: int,
    say: Callable[[str], None] = print,
    more: Sequence[Rows] = (),
) -> Surrogate:
    """Returns the surrogate of all pours of an archive, and of `more`."""
    rows, design = store.pours(), store.plan.design
    whole = [rows, *more]
    theta = np.concatenate([part.theta for part in whole])
    condition = np.concatenate([part.condition for part in whole])
    psi = np.concatenate([part.psi for part in whole])
    x = np.concatenate([part.x for part in whole])
    say(f"surrogate of {len(x)} pours (left out: {rows.left_out})")
    return Surrogate.fit(design, theta, condition, psi, x, names=rows.names, seed=seed)
