"""The data sets that an archive is made of, each a batch of `generate`."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.pours.plan import ArchivePlan
from granulcal.pours.dataset import Dataset
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

__all__ = ["Part", "parts_of"]

Array = NDArray[np.float64]

# Strengths at which an effect of a whole number is tried.
_WHOLE_STRENGTHS = (0.25, 0.5, 0.75, 1.0)
# Seeds of the parts, so that no two share a pour.
_SEED_STEP, _PLACE_STEP, _FREE_STEP = 1009, 101, 10_000_019


@dataclass(frozen=True)
class Part:
    """One data set.

    Attributes:
        name: of its folder.
        scene: what is poured.
        prior: of all that is drawn: parameters, conditions, the effect's number.
        count: pours.
        seed: of all of them.
        effect: name of the effect that it is of; empty for the base model.
        place: numbers of the condition that it is at, where pours are at these alone.
    """

    name: str
    scene: Scene
    prior: Prior
    count: int
    seed: int
    effect: str = ""
    place: dict[str, float] = field(default_factory=dict)

    def at(self, places: tuple[dict[str, float], ...]) -> list["Part"]:
        """Returns the part at each of `places`, its pours dealt out; itself if there are none."""
        if not places:
            return [self]
        share = -(-self.count // len(places))
        return [
            replace(
                self,
                name=f"{self.name}-at-{i}",
                scene=self.scene.with_(place),
                count=share,
                seed=self.seed + _PLACE_STEP * i,
                place=place,
            )
            for i, place in enumerate(places)
        ]

    def strengths(self, data: Dataset, usable: NDArray[np.bool_], effect: LibraryEffect) -> Array:
        """Returns how strong `effect`, at the base scene, was in its usable pours, shape (n,)."""
        count = int(usable.sum())
        if effect.held is not None:
            return np.ones(count)
        if effect.whole:
            # A whole number may lie half a grain beyond full strength.
            strength = effect.strength(np.full(count, self.scene.get(effect.path)))
            return np.clip(strength, -1.0, 1.0)
        return effect.strength(data.theta[usable, data.theta_names.index(effect.path)])


def parts_of(plan: ArchivePlan) -> list[Part]:
    """Returns the data sets of an archive, the base model's first."""
    # At the conditions alone their numbers are set, and definitions still drawn.
    placed = plan.places[0] if plan.places else {}
    drawn = [condition for condition in plan.conditions if condition[0] not in placed]
    inputs = [
        Parameter(path=path, distribution="uniform", low=low, high=high)
        for path, low, high in drawn
    ]
    common = [*plan.prior.parameters, *inputs]
    parts = [Part("base", plan.scene, Prior(common), plan.base - plan.images, plan.seed)]
    for number, effect in enumerate(plan.library, start=1):
        if not effect.is_free:
            parts += _of_effect(plan, effect, common, plan.seed + _SEED_STEP * number)
    found, seeds = [], set()
    for piece in (piece for part in parts for piece in part.at(plan.places)):
        seed = piece.seed
        # From eleven places on the steps meet; parts of a shorter library keep their seeds.
        while seed in seeds:
            seed += _FREE_STEP
        seeds.add(seed)
        found.append(replace(piece, seed=seed))
    return found


def _of_effect(
    plan: ArchivePlan, effect: LibraryEffect, common: list[Parameter], seed: int
) -> list[Part]:
    own, name = effect.at(plan.scene), f"effect-{effect.name}"
    each = plan.each - (plan.images_each if plan.is_crossed(effect) else 0)
    if own.held is not None or not own.whole:
        scene = plan.scene.with_(dict(own.also)) if own.also else plan.scene
        prior = Prior(common if own.held is not None else [*common, own.parameter()])
        return [Part(name, scene, prior, each, seed, effect.name)]
    share = -(-each // len(_WHOLE_STRENGTHS))
    return [
        Part(
            f"{name}-{number}",
            plan.scene.with_({own.path: own.value(psi)}),
            Prior(common),
            share,
            seed + number + 1,
            effect.name,
        )
        for number, psi in enumerate(_WHOLE_STRENGTHS)
    ]
