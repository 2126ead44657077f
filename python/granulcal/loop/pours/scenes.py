"""The scene of a model under a condition, and the faults of its image."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.pours.cube import from_cube
from granulcal.loop.task import Condition, Task
from granulcal.pours.scene import Scene

__all__ = ["faults_of", "scene_of"]

Array = NDArray[np.float64]


def scene_of(
    task: Task, condition: Condition, theta: Array, strengths: Mapping[str, float]
) -> Scene:
    """Returns the scene of a model under a condition.

    Args:
        task: scene and prior.
        condition: the numbers that it states.
        theta: parameters in unit coordinates, shape (p,).
        strengths: psi of each effect of the model, by name.
    """
    own = from_cube(task.prior, theta[None])[0]
    values = {**task.prior.fixed, **dict(zip(task.prior.names, own.tolist(), strict=True))}
    at = dict(condition.at)
    for name, psi in strengths.items():
        effect = task.effect(name)
        values |= effect.numbers(float(psi))
        values |= {p: v for p, v in condition.known.items() if p in values or _kin(p, effect.path)}
        if effect.shift:
            at[effect.path] += effect.full * float(psi)
    return task.scene.with_({**values, **at})


def faults_of(task: Task, strengths: Mapping[str, float]) -> dict[str, float]:
    """Returns the faults of the image of a model, by kind, from psi of its effects by name."""
    found: dict[str, float] = {}
    for name, psi in strengths.items():
        found |= task.effect(name).faults(float(psi))
    return found


def _kin(path: str, other: str) -> bool:
    """Whether two numbers belong to one table of effects."""
    return path.rpartition(".")[0] == other.rpartition(".")[0]
