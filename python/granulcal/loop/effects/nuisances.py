"""Declared tolerances of a task: effects of the library, or any number of the scene.

    [nuisances]
    "tilt.x" = 0.005
    "height" = 0.001
    "observe.begin" = { sd = 0.02, shared = false }

An effect of the library goes by its name. Any other name is a path of the scene: the number may be
off by the standard deviation `sd`, in its unit, to both sides; the archive has pours at up to two
of them. `shared` says whether one value holds for all conditions (a threshold, a drive's speed) or
each condition has its own (a clock that is set by hand each time).
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.library import LIBRARY, LibraryEffect, by_name
from granulcal.pours.scene import Scene

__all__ = ["declared_nuisances"]

# The archive's pours reach so many standard deviations to each side.
_REACH = 2.0


def declared_nuisances(table: Mapping[str, Any], scene: Scene) -> tuple[LibraryEffect, ...]:
    """Returns the tolerances that a task declares, those of the library first.

    Args:
        table: standard deviation of each, or `{ sd = ..., shared = ... }`.
        scene: whose own numbers they start from.

    Raises:
        ObservationError: a table with other keys.
        TrainingDataError: a name that is no effect and no path, or an sd that is not positive.
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
    found = [effect.declared(sds[effect.name], scene) for effect in named]
    found += [_of_path(path, sds[path], scene) for path in paths]
    return tuple(
        replace(effect, is_shared=shared.get(effect.name, effect.is_shared)) for effect in found
    )


def _of_path(path: str, sd: float, scene: Scene) -> LibraryEffect:
    """The number of a path as a tolerance to both sides."""
    if not sd > 0:
        raise TrainingDataError(f"tolerance of {path} must be positive, got {sd}")
    off = scene.get(path)
    return LibraryEffect(
        name=path,
        path=path,
        off=off,
        full=off + _REACH * sd,
        is_two_sided=True,
        doc="a number of the scene that may be off",
        nuisance_sd=1 / _REACH,
    )
