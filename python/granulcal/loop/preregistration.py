"""What is fixed before the first residual is seen, in a file with a hash."""

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from granulcal.documents import LARGEST_DOCUMENT, Table, check, parse_json, read_bytes
from granulcal.engines.in_use import law_of_pours, version_of_pours
from granulcal.errors import ObservationError
from granulcal.files import write_beside
from granulcal.loop.effects.library import described, fingerprint
from granulcal.loop.pours.archive import ArchivePlan
from granulcal.loop.task import Task
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["register"]

_NAME = "preregistration.json"


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
            differing = [k for k, v in mine.items() if theirs.get(k) != v]
            raise ObservationError(
                f"{path} was registered for another analysis ({', '.join(differing)} differ); "
                "what was fixed stays fixed: give another folder with -o"
            )
    else:
        write_beside(path, text)
    return hashlib.sha256(text.encode()).hexdigest()


def _digests(recordings: tuple[Path, ...]) -> list[str]:
    """Hashes of the files, so that they cannot be exchanged; nothing of them is read."""
    found = []
    for path in recordings:
        files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        digest = hashlib.sha256()
        for file in files:
            digest.update(file.read_bytes())
        found.append(f"{path.name} {digest.hexdigest()}")
    return found
