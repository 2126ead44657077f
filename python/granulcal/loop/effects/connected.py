"""Connected bodies of an image: pixels of grain joined by steps to their neighbours."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["bodies"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def bodies(x: Array, y: Array, is_grain: Mask, reach: float) -> NDArray[np.intp]:
    """A number for each grain pixel, the same within a body: neighbours no farther than `reach`."""
    count = int(is_grain.sum())
    index = np.full(is_grain.shape, -1, dtype=np.intp)
    index[is_grain] = np.arange(count)
    px, py = x[is_grain], y[is_grain]
    pairs = []
    for a, b in (
        (index[:, :-1], index[:, 1:]),
        (index[:-1], index[1:]),
        (index[:-1, :-1], index[1:, 1:]),
        (index[:-1, 1:], index[1:, :-1]),
    ):
        both = (a >= 0) & (b >= 0)
        pairs.append(np.stack([a[both], b[both]]))
    a, b = np.concatenate(pairs, axis=1)
    near = np.hypot(px[a] - px[b], py[a] - py[b]) <= reach
    a, b = a[near], b[near]
    label = np.arange(count)
    while True:
        low = np.minimum(label[a], label[b])
        joined = label.copy()
        # The roots of both take the smaller name, then every pixel that of its root.
        for end in (label[a], label[b], a, b):
            np.minimum.at(joined, end, low)
        joined = joined[joined]
        if np.array_equal(joined, label):
            return label
        label = joined
