"""What is fixed before the first residual is seen, in a file with a hash."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from granulcal.documents import LARGEST_DOCUMENT, Table, check, parse_json, parse_toml, read_bytes
from granulcal.engines.in_use import law_of_pours, version_of_pours
from granulcal.errors import ObservationError
from granulcal.files import write_beside
from granulcal.loop.condition import digest_of
from granulcal.loop.effects.library import described, fingerprint
from granulcal.loop.pours.archive import ArchivePlan
from granulcal.loop.pours.measures import camera_used
from granulcal.loop.task import Condition, Task
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["register"]

_NAME = "preregistration.json"
# Keys of a condition that registrations of before have not.
_CAMERAS, _KNOWN = "cameras", "known"


def register(
    folder: Path,
    task: Task,
    plan: ArchivePlan,
    thresholds: Thresholds,
    seed: int,
    statistics: tuple[str, ...],
    pairs: int = 0,
    rounds: int = 0,
) -> str:
    """Writes the file, or finds it as it is; returns its SHA-256.

    One that says the same in other bytes is taken as it stands, and so is one of before, which does
    not say by which camera recordings are read.

    Raises:
        ObservationError: the folder holds the registration of another analysis.
    """
    document: dict[str, Any] = (
        {
            "version": version_of_pours(),
            "law": law_of_pours(plan.scene),
            "scene": plan.scene.to_toml(),
            "prior": plan.prior.to_toml(),
            "conditions": [
                {"name": c.name, "at": c.at, "use": c.use, "recordings": _digests(c.recordings)}
                | {_CAMERAS: _cameras(c, task)}
                | ({_KNOWN: c.known} if c.known else {})
                | ({"reading": c.reading} if c.reading else {})
                | ({"averaged": True} if c.averaged else {})
                | ({"session": c.session} if c.session else {})
                for c in task.conditions
            ],
            "library": [described(effect) for effect in task.library],
            "library_sha256": fingerprint(task.library),
            "statistics": list(statistics),
            "archive": {"base": plan.base, "each": plan.each, "seed": plan.seed},
            "tolerances_sha256": None if task.tolerances is None else task.tolerances.fingerprint(),
            "thresholds": thresholds.to_dict(),
            "seed": seed,
        }
        | ({"pairs": pairs} if pairs else {})
        | ({"rounds": rounds} if rounds else {})
        | ({"definitions": [asdict(one) for one in task.definitions]} if task.definitions else {})
    )
    text = json.dumps(document, indent=1) + "\n"
    path = folder / _NAME
    if path.exists():
        found = read_bytes(path, most=LARGEST_DOCUMENT)
        if found != text.encode():
            theirs = parse_json(found, path, error=ObservationError)
            check(theirs, Table({}, open=True), path, error=ObservationError)
            mine = parse_json(text.encode(), path)
            if theirs in (mine, _as_before(mine)):
                return hashlib.sha256(found).hexdigest()
            # Some keys are there only where they say something.
            differing = [k for k in (mine | theirs) if mine.get(k) != theirs.get(k)]
            raise ObservationError(
                f"{path} was registered for another analysis ({', '.join(differing)} differ); "
                "what was fixed stays fixed: give another folder with -o"
            )
    else:
        write_beside(path, text)
    return hashlib.sha256(text.encode()).hexdigest()


def _digests(recordings: tuple[Path, ...]) -> list[str]:
    """Hashes of the files, so that they cannot be exchanged; nothing of them is read."""
    return [f"{path.name} {digest_of(path)}" for path in recordings]


def _cameras(condition: Condition, task: Task) -> list[str | None]:
    """Hashes of the cameras by which images are read, with the colour images that they name."""
    if task.scene.observed_names:
        return []
    found: list[str | None] = []
    for recording in condition.recordings:
        camera = camera_used(recording, condition.camera)
        if camera is None:
            found.append(None)
            continue
        text = camera.read_bytes()
        digest = hashlib.sha256(text)
        colour = _colour_of(text)
        if colour is not None and (image := camera.parent / colour).is_file():
            digest.update(image.read_bytes())
        found.append(f"{camera.name} {digest.hexdigest()}")
    return found


def _colour_of(camera: bytes) -> str | None:
    """The colour image that a camera's TOML names; what is no TOML is refused where it is read."""
    try:
        document = parse_toml(camera, "camera")
    except ValueError:
        return None
    found = document.get("colour") if isinstance(document, dict) else None
    return found if isinstance(found, str) else None


def _as_before(document: dict[str, Any]) -> dict[str, Any]:
    """Returns a registration as it was written before cameras were fixed in it."""
    kept = [
        {k: v for k, v in condition.items() if k not in (_CAMERAS, _KNOWN)}
        for condition in document["conditions"]
    ]
    return {**document, "conditions": kept}
