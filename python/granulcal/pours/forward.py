"""Pours at chosen parameters, several seeds at once."""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor

from numpy.typing import ArrayLike

from granulcal.bayessim.arrays import as_matrix
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour, simulate
from granulcal.prior import Prior

__all__ = ["pours_at", "scene_at"]


def scene_at(scene: Scene, prior: Prior, theta: ArrayLike) -> Scene:
    """Returns `scene` with the prior's fixed parameters and these values of the free ones.

    Args:
        scene: the scene before the prior's parameters are set.
        prior: names the parameters.
        theta: values in own units, shape (p,).
    """
    values = as_matrix("theta", theta, columns=len(prior.names))[0]
    changes: Mapping[str, float] = {
        **prior.fixed,
        **dict(zip(prior.names, values.tolist(), strict=True)),
    }
    return scene.with_(changes)


def pours_at(scene: Scene, seeds: Sequence[int], *, threads: int | None = None) -> list[Pour]:
    """Returns the pours of `scene` with each of `seeds`, simulated side by side.

    Args:
        scene: what is poured.
        seeds: one for each pour.
        threads: pours at once; the default is one for each core.
    """
    workers = threads or os.cpu_count() or 1
    with ThreadPoolExecutor(min(workers, max(len(seeds), 1))) as pool:
        return list(pool.map(lambda seed: simulate(scene, seed=seed), seeds))
