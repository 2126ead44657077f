"""The whole plan simulated: each pour falls beside the grains of those before it."""

import re
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.design.plan import Plan
from granulcal.design.ring import PERCENTILES
from granulcal.design.ring_model import HEIGHT
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate

__all__ = ["Pattern", "require_one_size", "simulate_plan"]

Array = NDArray[np.float64]

_WRONG = {
    "jammed": "jams: its grains, held together by those around them, reach the funnel's tip; "
    "pour it from higher",
    "unhealthy": "is unhealthy: the simulation lost its accuracy, try another seed",
    "horizon": "has not come to rest: its grains still move at end.horizon; take a longer one",
}


@dataclass(frozen=True)
class Pattern:
    """Grains of a plan's pours at the end of the last.

    Attributes:
        positions: centres [m], shape (n, 3).
        radii: of the grains [m], shape (n,).
        pour: index of the pour that each grain came with, shape (n,).
        statuses: how each pour ended.
        rings: inner and outer radius of each pour's grains at the end [m], shape (pours, 2).
        scene: of the last pour.
    """

    positions: Array
    radii: Array
    pour: NDArray[np.intp]
    statuses: tuple[str, ...]
    rings: Array
    scene: Scene

    @property
    def notes(self) -> tuple[str, ...]:
        """What went wrong, a sentence for each pour that is not at rest or cannot be used."""
        return tuple(
            f"pour {i} {_WRONG[status]}"
            for i, status in enumerate(self.statuses, start=1)
            if status in _WRONG
        )

    @property
    def is_whole(self) -> bool:
        """Whether every pour left the funnel, came to rest and can be trusted."""
        return not self.notes

    def __str__(self) -> str:
        """One line a pour, centimetres."""
        return "\n".join(
            f"simulated, with all pours on the ground: pour {i} {status}, its grains' radii "
            f"{100 * inner:.2f} / {100 * outer:.2f} cm"
            for i, (status, (inner, outer)) in enumerate(
                zip(self.statuses, self.rings, strict=True), start=1
            )
        )


def simulate_plan(plan: Plan, *, seed: int = 0) -> Pattern:
    """Returns the grains after all pours, one after another onto the same ground.

    Args:
        plan: the pours.
        seed: of the first pour; the next has the next.

    Raises:
        ValueError: several pours of grains that differ in size.
    """
    scene = Scene.from_toml(plan.scene_toml)
    if len(plan.pours) > 1:
        require_one_size(scene)
    positions, owner = np.empty((0, 3)), np.empty(0, np.intp)
    pours = []
    for i, planned in enumerate(plan.pours):
        above = scene.with_({HEIGHT: planned.height})
        # Where the new grains hang before they fall, whatever the scene's start is.
        new, _ = above.start(seed + i)
        positions = np.concatenate([new, positions])
        owner = np.concatenate([np.full(len(new), i), owner])
        pour = simulate(_starting_at(above, positions), seed=seed + i)
        positions = pour.positions
        pours.append(pour)
    distance = np.hypot(positions[:, 0], positions[:, 1])
    rings = [np.percentile(distance[owner == i], PERCENTILES) for i in range(len(plan.pours))]
    statuses = tuple(pour.status for pour in pours)
    return Pattern(positions, pours[-1].radii, owner, statuses, np.array(rings), pours[-1].scene)


def require_one_size(scene: Scene) -> None:
    """Refuses grains that differ in size: those on the ground would get others with the next pour.

    Raises:
        ValueError: names what makes them differ.
    """
    if "polydispersity" in scene.to_dict().get("effects", {}):
        raise ValueError(
            f"{scene.name}: a plan of several rings pours grains of one size beside each other; "
            "effects.polydispersity must be left out, or one ring asked for"
        )


def _starting_at(scene: Scene, positions: Array) -> Scene:
    """The scene with these grains at rest in place of its start [m], shape (n, 3)."""
    listed = ", ".join(f"[{x:.9g}, {y:.9g}, {z:.9g}]" for x, y, z in positions)
    start = f'[start]\nkind = "positions"\npositions = [{listed}]\n\n'
    text = re.sub(r"(?ms)^\[start\]\n.*?(?=^\[)", start, scene.to_toml(), count=1)
    # Of every grain that is there, where the scene states the volume of a pour, too.
    stated = r"(?ms)(^\[grains\]\n(?:(?!^\[).)*?)^(?:count|volume) = [^\n]*$"
    text = re.sub(stated, rf"\g<1>count = {len(positions)}", text, count=1)
    return Scene.from_toml(text)
