"""Declared tolerances of a task: effects of the library, or any number of the scene.

    [nuisances]
    "tilt.x" = 0.005
    "height" = 0.001
    "observe.begin" = { sd = 0.02, shared = false }

An effect of the library goes by its name. Any other name is a path of the scene: the number may be
off by the standard deviation `sd`, in its unit, to both sides; the archive has pours at up to two
of them. Where conditions differ in the number, each may be off what it states: base pours, read
anew. `shared` says whether one value holds for all conditions (a threshold, a drive's speed) or
each condition has its own (a clock that is set by hand each time, and a number in which conditions
differ unless told otherwise).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.askable import is_whole
from granulcal.loop.effects.library import LIBRARY, LibraryEffect, by_name
from granulcal.pours.scene import Scene

__all__ = ["declared_nuisances"]

# The archive's pours reach so many standard deviations to each side.
_REACH = 2.0


def declared_nuisances(
    table: Mapping[str, Any], scene: Scene, ats: Sequence[Mapping[str, float]] = ()
) -> tuple[LibraryEffect, ...]:
    """Returns the tolerances that a task declares, those of the library first.

    Args:
        table: standard deviation of each, or `{ sd = ..., shared = ... }`.
        scene: whose own numbers they start from.
        ats: numbers that each condition states in place of the scene's.

    Raises:
        ObservationError: a table with other keys.
        TrainingDataError: a name that is no effect and no path, or an sd that is not positive, or
            larger than the number.
    """
    sds: dict[str, float] = {}
    shared: dict[str, bool] = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            unknown = sorted(set(value) - {"sd", "shared"})
            if unknown or "sd" not in value:
                raise ObservationError(
                    f"nuisance {name} must be a number or {{ sd = ..., shared = ... }}, "
                    f"got {dict(value)}"
                )
            if "shared" in value:
                shared[name] = bool(value["shared"])
            value = value["sd"]
        sds[name] = float(value)
    known = [effect.name for effect in LIBRARY]
    paths = [name for name in sds if name not in known and "." in name and scene.has(name)]
    named = by_name(name for name in sds if name not in paths)
    found = [effect.declared(sds[effect.name], _there(scene, effect, ats)) for effect in named]
    found += [_of_path(path, sds[path], scene, ats) for path in paths]
    # A path that conditions differ in goes by another name than the path's.
    told = [*(effect.name for effect in named), *paths]
    return tuple(
        replace(effect, is_shared=shared.get(name, effect.is_shared))
        for name, effect in zip(told, found, strict=True)
    )


def _there(scene: Scene, effect: LibraryEffect, ats: Sequence[Mapping[str, float]]) -> Scene:
    """The scene with an effect's number as all conditions state it."""
    values = {at[effect.path] for at in ats if effect.path in at}
    number = {effect.path: values.pop()} if len(values) == 1 else {}
    # What it does not take is the condition's fault, and told as that.
    return scene if scene.refusal(number) else scene.with_(number)


def _of_path(
    path: str, sd: float, scene: Scene, ats: Sequence[Mapping[str, float]]
) -> LibraryEffect:
    """The number of a path as a tolerance to both sides."""
    if not sd > 0:
        raise TrainingDataError(f"tolerance of {path} must be positive, got {sd}")
    values = sorted({at[path] for at in ats if path in at}) or [scene.get(path)]
    off = values[0]
    if is_whole(scene, path, off):
        raise TrainingDataError(
            f"{path} is a whole number, and a tolerance has any value between: declare those of "
            "the library by their names (count)"
        )
    largest = max(abs(value) for value in values)
    if sd > largest > 0:
        raise TrainingDataError(
            f"tolerance of {path} must be at most {largest:g}, the number itself, got {sd:g}; what "
            "is known within a factor is a [[nuisance]] with a distribution of its own"
        )
    if len(values) > 1:
        if sd > values[-1] - off:
            raise TrainingDataError(
                f"tolerance of {path} must be at most {values[-1] - off:g}, by which the "
                f"conditions differ, got {sd:g}"
            )
        return LibraryEffect(
            # The path alone is the condition's number.
            name=f"{path} as stated",
            path=path,
            full=_REACH * sd,
            is_two_sided=True,
            shift=True,
            doc="a condition's own number may be off what is stated",
            nuisance_sd=1 / _REACH,
            is_shared=False,
        )
    return LibraryEffect(
        name=path,
        path=path,
        off=off,
        full=off + _REACH * sd,
        is_two_sided=True,
        doc="a number of the scene that may be off",
        nuisance_sd=1 / _REACH,
    )
