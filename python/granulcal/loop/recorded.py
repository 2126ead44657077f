"""Whether a task's recordings are pours of its scene, each another one: asked before any pour.

A measurement that is none must not become a finding: a file in another unit would be a strong one.
A recording is refused where it could be of neither the scene nor the scene with any effect of the
task at full strength.
"""

import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median_low
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.errors import ObservationError
from granulcal.loop.condition import Condition, digest_of
from granulcal.loop.effects.library import LibraryEffect
from granulcal.loop.pours.measures import camera_used
from granulcal.measured.different import first_copy
from granulcal.measured.plausible import doubts, doubts_of_frames, violations
from granulcal.measured.recording import Formation, Recording, UnlikeFramesWarning
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["doubt_of_start", "doubts_of", "require_no_copies"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Share of pixels without data from which the number of pixels shows it: that of a pour's scatters
# by half a per cent.
_MISSING = 0.005
# Share by which the distance of the ground may be off the scene's: what stereo cameras promise of
# their depths.
_DISTANCE = 0.02
# Heights above the ground from which grains are let go, and what hangs there.
_LET_GO = (
    ("funnel.height", "the funnel's tip"),
    ("start.height", "the grains' lowest point"),
)


def require_no_copies(conditions: Sequence[Condition], rows: Sequence[Array]) -> None:
    """Refuses copies of one pour under other names: they would count as several.

    Args:
        conditions: all of a task.
        rows: statistics of the pours of each, shape (n, s); none where equal numbers are no copies.

    Raises:
        ObservationError: two recordings are the same.
    """
    seen: dict[tuple[str, str], str] = {}
    read: list[Array] = []
    names: list[str] = []
    for condition, own in zip(conditions, rows, strict=True):
        for path in condition.recordings:
            # One file may hold several curves.
            key = digest_of(path), str(condition.reading.get("series"))
            _refuse_copy(seen.get(key), f"{path} of {condition.name!r}", "the same bytes")
            seen[key] = f"{path} of {condition.name!r}"
        for path, row in zip(condition.recordings, own, strict=False):
            names.append(f"{path} of {condition.name!r}")
            read.append(row)
    if (copy := first_copy(read)) is not None:
        _refuse_copy(names[copy[0]], names[copy[1]], "the same statistics, to the last digit")


def _refuse_copy(first: str | None, second: str, what: str) -> None:
    if first is not None:
        raise ObservationError(f"{first} and {second} have {what}: each pour counts once")


def doubts_of(
    conditions: Sequence[Condition],
    scene: Scene,
    prior: Prior,
    library: Sequence[LibraryEffect],
) -> list[str]:
    """Returns what makes the images of conditions doubtful, a sentence each.

    Args:
        conditions: all of a task.
        scene: the base model.
        prior: of its parameters.
        library: effects of the task.

    Raises:
        ObservationError: an image that can be neither of the scene nor of it with an effect.
    """
    found: list[str] = []
    distances: list[float] = []
    images = [c for c in conditions if not scene.with_(c.at).observed_names]
    for condition in images:
        of_it, distance = _doubts_of_one(condition, scene, prior, library)
        found += of_it
        distances.append(distance)
    return [*_doubts_of_distance(images, scene, distances), *found]


def _doubts_of_one(
    condition: Condition, scene: Scene, prior: Prior, library: Sequence[LibraryEffect]
) -> tuple[list[str], float]:
    """Doubts of a condition's images, and the distance of the ground of most of them [m]."""
    there = scene.with_(condition.at)
    found: list[str] = []
    missing: list[float] = []
    distances: list[float] = []
    opened: list[Recording] = []
    for path in condition.recordings:
        recording = _opened(path, condition)
        opened.append(recording)
        of_it = ([recording], [path], condition.reading)
        impossible = violations(there, prior, *of_it)
        if impossible and all(violations(s, prior, *of_it) for s in _with_effects(there, library)):
            raise ObservationError(
                f"{'; '.join(impossible)}: this can be no formation of the scene under "
                f"{condition.name!r}, whatever its material and with any effect of the task"
            )
        if recording.unlike is not None:
            found.append(f"{path}: {recording.unlike}")
        found += doubts(there, prior, *of_it)
        settings: dict[str, Any] = {**there.reading, **condition.reading}
        formation = recording.formation(**settings)
        missing.append(_missing_share(formation))
        distances.append(abs(formation.plane.offset))
    found += doubts_of_frames(there, prior, opened, condition.recordings)
    of_start = doubt_of_start(condition.name, there)
    of_images = [
        *_doubt_of_missing(there, condition, missing),
        *_doubt_of_odd(there, condition, distances),
    ]
    return [*of_start, *of_images, *found], median_low(distances)


def _opened(path: Path, condition: Condition) -> Recording:
    """A recording; frames that are not of one picture are told by the doubts."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnlikeFramesWarning)
        return Recording.open(path, camera=camera_used(path, condition.camera))


def doubt_of_start(name: str, there: Scene) -> list[str]:
    """Returns whether grains are let go above the camera, as with a height in another unit."""
    tables = there.to_dict()
    camera = tables["camera"]
    if camera["projection"] != "pinhole":
        return []
    for path, what in _LET_GO:
        table, key = path.split(".")
        height = tables.get(table, {}).get(key)
        if height is not None and height >= camera["height"]:
            return [
                f"{name}: {what} ({path} = {height:g} m) is above the camera "
                f"(camera.height = {camera['height']:g} m): is it in metres?"
            ]
    return []


def _doubts_of_distance(
    conditions: Sequence[Condition], scene: Scene, distances: Sequence[float]
) -> list[str]:
    """Whether the ground is as far from the camera as the scene says, a sentence each.

    Depths have their own scale in it. One recording speaks for those of its condition, of which
    the odd ones are told. Where it is so far off that the doubts of a recording ask for the unit,
    they have said it.

    Args:
        conditions: those of images.
        scene: the base model.
        distances: of the ground from the camera under each, of most recordings [m].
    """
    conditions_of: dict[tuple[float, float], list[str]] = {}
    for condition, found in zip(conditions, distances, strict=True):
        camera = scene.with_(condition.at).to_dict()["camera"]
        if camera["projection"] != "pinhole":
            continue
        stated = float(camera["height"])
        if _is_off(found, stated):
            key = stated, float(f"{found:.3g}")
            conditions_of.setdefault(key, []).append(condition.name)
    return [
        f"{', '.join(names)}: the ground lies {found:g} m from the camera, of the scene's images "
        f"camera.height = {stated:g} m: if that is where it stands, depths and all lengths that "
        f"are told by them are {100 * abs(found / stated - 1):.2g} % too "
        f"{'large' if found > stated else 'small'} (the unit or the calibration of the depths); if "
        "not, say the height in the scene"
        for (stated, found), names in conditions_of.items()
    ]


def _doubt_of_odd(there: Scene, condition: Condition, distances: Sequence[float]) -> list[str]:
    """Whether recordings of one condition are not all of one camera at one place."""
    if there.to_dict()["camera"]["projection"] != "pinhole":
        # A map has its heights from anywhere.
        return []
    usual = median_low(distances)
    odd = [
        f"{path} ({found:.3g} m)"
        for path, found in zip(condition.recordings, distances, strict=True)
        if _is_off(found, usual)
    ]
    if not odd:
        return []
    return [
        f"{condition.name}: the ground of {', '.join(odd)} is not as far from the camera as that "
        f"of the other recordings ({usual:.3g} m): is it of another camera, whose lens it needs, "
        "or of one that was moved?"
    ]


def _is_off(found: float, usual: float) -> bool:
    """Whether a distance differs by more than depths do, and by less than another unit makes."""
    return 1 + _DISTANCE < max(found / usual, usual / found) <= _native.UNIT_FACTOR


def _missing_share(formation: Formation) -> float:
    """The share of the pixels about a formation that have no data.

    What lies beyond all data of its row or of its column is outside of the image, and no hole: a
    levelled image may have a rim of such pixels, which one grain at its edge brings in.
    """
    rows, columns = (np.flatnonzero(formation.mask.any(axis=axis)) for axis in (1, 0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    is_known = np.isfinite(formation.heights)
    is_inside = (_is_between(is_known, 0) & _is_between(is_known, 1))[box]
    return float(np.mean(~is_known[box][is_inside])) if is_inside.any() else 0.0


def _is_between(is_known: Mask, axis: int) -> Mask:
    """Which entries have a known one on either side along an axis, or are known, shape kept."""
    before = np.logical_or.accumulate(is_known, axis=axis)
    after = np.flip(np.logical_or.accumulate(np.flip(is_known, axis), axis=axis), axis)
    return before & after


def _doubt_of_missing(there: Scene, condition: Condition, shares: Sequence[float]) -> list[str]:
    """Whether pixels have no data where those of the scene's images have."""
    if "sensor" in there.to_dict()["camera"]:
        return []
    most = int(np.argmax(shares))
    if shares[most] < _MISSING:
        return []
    return [
        f"{condition.name}: up to {100 * shares[most]:.2g} % of the pixels about the formation "
        f"have no data ({condition.recordings[most]}), of the scene's images none: what counts "
        "pixels falls short by as much, as if grains were fewer; let the scene's camera have the "
        "sensor of this one (granulcal-cli fit-sensor)"
    ]


def _with_effects(there: Scene, library: Sequence[LibraryEffect]) -> Iterator[Scene]:
    """Scenes with each effect at full strength, to both sides if it has two."""
    for entry in library:
        effect = entry.at(there)
        for psi in (1.0, -1.0) if effect.is_two_sided else (1.0,):
            numbers = effect.numbers(psi)
            if numbers and there.refusal(numbers) is None:
                yield there.with_(numbers)
