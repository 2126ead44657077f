"""Sealed answers: one JSON a set, and its SHA-256 beside the sets.

A salt in each answer keeps anyone from guessing it by its hash.
"""

import fcntl
import hashlib
import json
from pathlib import Path

SEALS = "seals.txt"


class BrokenSealError(ValueError):
    """An answer is not the one that was sealed."""


def write_text(path: Path, text: str) -> None:
    """Writes a whole file or none."""
    draft = path.with_name(f".{path.name}.part")
    draft.write_text(text)
    draft.replace(path)


def seals(sets: Path) -> dict[str, str]:
    """Returns the hash of each answer by the name of its set; empty before the first."""
    file = sets / SEALS
    if not file.exists():
        return {}
    pairs = (line.split() for line in file.read_text().splitlines())
    return {name: digest for digest, name in pairs}


def seal(answer: dict, sealed: Path, sets: Path) -> None:
    """Writes an answer to `sealed` and its hash to the list in `sets`."""
    text = json.dumps(answer, indent=1)
    write_text(sealed / f"{answer['set']}.json", text)
    with (sets / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # Several makers may share one folder.
        known = {**seals(sets), answer["set"]: hashlib.sha256(text.encode()).hexdigest()}
        lines = (f"{digest}  {name}\n" for name, digest in sorted(known.items()))
        write_text(sets / SEALS, "".join(lines))


def unseal(sealed: Path, sets: Path) -> dict[str, dict]:
    """Returns the answers by the name of their set.

    Raises:
        BrokenSealError: an answer is missing or has another hash than when it was sealed.
    """
    answers = {}
    for name, digest in seals(sets).items():
        file = sealed / f"{name}.json"
        if not file.exists():
            raise BrokenSealError(f"{name}: its answer is not in {sealed}")
        text = file.read_bytes()
        found = hashlib.sha256(text).hexdigest()
        if found != digest:
            raise BrokenSealError(f"{name}: its answer has the hash {found}, sealed was {digest}")
        answers[name] = json.loads(text)
    return answers
