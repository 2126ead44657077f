"""Pours at chosen parameters, several seeds at once."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from granulcal.bayessim.arrays import as_matrix
from granulcal.cores import cores
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour, simulate
from granulcal.prior import Prior
from granulcal.progress import steps

if TYPE_CHECKING:
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["draws_of", "pours_at", "scene_at"]

# Seeds of pours at draws: far from those of data sets, which are hashes, and of pours at the mode.
_FIRST_DRAW = 19_000


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
    return _side_by_side([scene] * len(seeds), seeds, threads)


def draws_of(
    scene: Scene, posterior: "Posterior", count: int, *, threads: int | None = None
) -> list[Pour]:
    """Returns pours at draws of a posterior, one each, simulated side by side; none unhealthy.

    Args:
        scene: the scene before the prior's parameters are set.
        posterior: of its parameters.
        count: number of draws.
        threads: pours at once; the default is one for each core.
    """
    scenes = [scene_at(scene, posterior.prior, theta) for theta in posterior.sample(count)]
    made = _side_by_side(scenes, range(_FIRST_DRAW, _FIRST_DRAW + count), threads)
    return [pour for pour in made if pour.status != "unhealthy"]


def _side_by_side(scenes: Sequence[Scene], seeds: Sequence[int], threads: int | None) -> list[Pour]:
    workers = threads or cores()
    with ThreadPoolExecutor(min(workers, max(len(seeds), 1))) as pool:
        pours = pool.map(lambda scene, seed: simulate(scene, seed=seed), scenes, seeds)
        return [next(pours) for _ in steps("pours", seeds)]
