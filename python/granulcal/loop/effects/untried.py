"""Which effects of the library a task does not try: a verdict chooses among those that it does."""

from collections.abc import Collection, Iterable

from granulcal.loop.effects.library import LIBRARY, LibraryEffect
from granulcal.pours.scene import Scene

__all__ = ["untried"]

# What a dry scene has none of: a number of it does nothing there.
_LIQUID, _LIQUID_HEIGHT = "effects.liquid.", "effects.liquid.height"


def untried(
    scene: Scene, tried: Iterable[LibraryEffect], known: Collection[str]
) -> tuple[LibraryEffect, ...]:
    """Returns the library's effects of the world that the scene takes and that are not tried.

    How something was seen is none of them, nor how far a condition's number is off. Of two effects
    on one number the scene has one: where it is tried, the other is left out.

    Args:
        scene: the base model.
        tried: effects and tolerances of the task.
        known: paths that conditions state, or that every fit has free.
    """
    names, paths = set(), set(known)
    for effect in tried:
        names.add(effect.name)
        paths.add(effect.path)
    is_dry = scene.get(_LIQUID_HEIGHT) == 0
    found = []
    for effect in LIBRARY:
        if effect.is_of_sight or effect.shift or effect.name in names or effect.path in paths:
            continue
        if is_dry and effect.path.startswith(_LIQUID):
            continue
        if scene.refusal(effect.at(scene).numbers(1.0)) is None:
            found.append(effect)
    return tuple(found)
