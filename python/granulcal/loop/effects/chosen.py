"""Which effects a task's file asks: those that it names, those that are usual, its tolerances."""

from collections.abc import Sequence
from pathlib import Path

from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.image_faults import require_image
from granulcal.loop.effects.library import FUNNEL, LibraryEffect, by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.pours.measures import is_above_axis
from granulcal.pours.scene import Scene

__all__ = ["USUAL", "chosen", "declared", "with_alike"]

USUAL = "usual"
"""Among a task's effects: all that are tried where it names none."""
_ASIDE = "camera.aside"
# What of the camera looks like an effect is asked wherever that is: it costs no pour.
_ALIKE = {"tilt": _ASIDE, "count": "camera.missing"}


def _default(
    scene: Scene, ats: Sequence[dict[str, float]], between: bool
) -> tuple[LibraryEffect, ...]:
    """The library where a task names no effects: without those that its scene cannot show.

    Nor those that are a number which its conditions, `ats`, state: what is known can be no finding;
    nor those on a condition's number where no pour lies beside the conditions.
    """
    stated = ats[0]
    beside = [path for path in stated if between and len({at.get(path) for at in ats}) > 1]
    library = tuple(
        effect
        for effect in FUNNEL
        if (effect.path in beside if effect.shift else effect.path not in stated)
    )
    if not _has_image(scene):
        return tuple(effect for effect in library if not effect.image)
    if not is_above_axis(scene):
        # A map has any origin.
        return tuple(effect for effect in library if effect.family != _ASIDE)
    return library


def chosen(
    named: list[str],
    scene: Scene,
    ats: Sequence[dict[str, float]],
    between: bool,
    file: Path,
) -> tuple[LibraryEffect, ...]:
    """Returns the effects that a file names, `USUAL` being all that are tried where none is."""
    usual = _default(scene, ats, between) if USUAL in named or not named else ()
    others = _named([name for name in named if name != USUAL], file)
    added = tuple(effect for effect in others if effect not in usual)
    return (*usual, *added)


def _named(names: list[str], file: Path) -> tuple[LibraryEffect, ...]:
    """The entries that a task's file names."""
    try:
        return by_name(names)
    except TrainingDataError as error:
        raise TrainingDataError(f"{file}: effects: {error}") from None


def declared(
    table: dict, scene: Scene, ats: list[dict[str, float]], file: Path
) -> tuple[LibraryEffect, ...]:
    """Returns the tolerances that a task's file declares."""
    try:
        return declared_nuisances(table, scene, ats)
    except TrainingDataError as error:
        raise TrainingDataError(f"{file}: nuisances: {error}") from None


def with_alike(library: tuple[LibraryEffect, ...], scene: Scene) -> tuple[LibraryEffect, ...]:
    """Returns the library, with what of the camera looks like one of its candidates."""
    if not _has_image(scene):
        return library
    has = {_kin(effect) for effect in library}
    asked = {_kin(effect) for effect in library if effect.nuisance_sd is None}
    wanted = {alike for kin, alike in _ALIKE.items() if kin in asked and alike not in has}
    if not is_above_axis(scene):
        wanted -= {_ASIDE}
    return (*library, *(effect for effect in FUNNEL if _kin(effect) in wanted))


def _kin(effect: LibraryEffect) -> str:
    return effect.family or effect.name


def _has_image(scene: Scene) -> bool:
    """Whether effects of the image apply to a scene."""
    try:
        require_image(scene, ("camera",))
    except ObservationError:
        return False
    return True
