"""A surrogate of single pours of a stand-in, for what it is sure and unsure of."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Surrogate

Array = NDArray[np.float64]
Pours = Callable[[float, float, Sequence[float], int, list[int]], Array]


def surrogate_of(pours: Pours, effects: Sequence[str], u: Array, c: Array, psi: Array) -> Surrogate:
    """Of a pour at each parameter, condition and strengths, shapes (n,), (n,), (n, effects)."""
    rows = zip(u, c, psi, strict=True)
    x = np.concatenate([pours(a, b, s.tolist(), 1, [7, i]) for i, (a, b, s) in enumerate(rows)])
    design = Design(("a",), ("height",), tuple(map(Effect, effects)))
    return Surrogate.fit(design, u[:, None], c[:, None], psi, x, features=4)
