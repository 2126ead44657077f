"""Definitions of what is observed: thresholds and levels that a verdict must not hang on.

    [[definitions]]
    name = "outline"                                # the first is the one that the verdict is of
    at = { "observe.front.link" = 1.5 }
    [[definitions]]
    name = "outline, wide links"
    at = { "observe.front.link" = 2.0 }
    reading = { cameras = "both" }

`at` are numbers of the scene that say how a pour is observed (`observe.*`, `camera.*`), `reading`
are arguments with which the recordings are read; both may be moved together. What differs between
definitions is an input of the archive, like a pour height: every pour has a value of its own
between the smallest and the largest one, and the surrogate knows all of them. So a further
definition costs a fit and no pour.
"""

from dataclasses import dataclass, field
from typing import Any

from granulcal.errors import ObservationError

__all__ = ["Definition", "check_definitions", "definition_inputs", "is_definition"]

_OBSERVING = ("observe.", "camera.")


@dataclass(frozen=True)
class Definition:
    """One way to observe the same pours.

    Attributes:
        name: what tables call it.
        at: numbers of the scene by path, of its `observe` or its `camera`.
        reading: arguments with which the recordings are read.
    """

    name: str
    at: dict[str, float] = field(default_factory=dict)
    reading: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, table: dict[str, Any]) -> "Definition":
        """Returns the definition in a table of a task file.

        Raises:
            ObservationError: a key that is missing or unknown.
        """
        unknown = sorted(set(table) - {"name", "at", "reading"})
        if unknown or "name" not in table:
            what = f"has unknown {', '.join(unknown)}" if unknown else "lacks name"
            raise ObservationError(f"a definition {what}; it has name and may have at, reading")
        at = {path: float(value) for path, value in table.get("at", {}).items()}
        return cls(str(table["name"]), at, dict(table.get("reading", {})))


def check_definitions(definitions: tuple[Definition, ...]) -> None:
    """Refuses definitions that change what is poured, or do not state the same numbers.

    Raises:
        ObservationError: the definition and the path.
    """
    names = [one.name for one in definitions]
    repeated = sorted({name for name in names if names.count(name) > 1})
    if repeated:
        raise ObservationError(f"definitions need names of their own, twice: {repeated}")
    for one in definitions:
        for path in one.at:
            if not is_definition(path):
                raise ObservationError(
                    f"definition {one.name}: {path} changes what is poured; a definition states "
                    "numbers of observe.* and camera.* alone"
                )
        if set(one.at) != set(definitions[0].at):
            raise ObservationError(
                f"definition {one.name}: definitions must state the same numbers, "
                f"{sorted(definitions[0].at)}; got {sorted(one.at)}"
            )


def is_definition(path: str) -> bool:
    """Returns whether a number of the scene says how a pour is observed, not what is poured."""
    return path.startswith(_OBSERVING)


def definition_inputs(definitions: tuple[Definition, ...]) -> tuple[tuple[str, float, float], ...]:
    """Returns path, least and largest value of each number that differs between definitions."""
    found = []
    for path in definitions[0].at if definitions else ():
        values = [one.at[path] for one in definitions]
        if min(values) < max(values):
            found.append((path, min(values), max(values)))
    return tuple(found)
