"""Documents that people and strangers hand in: read with a bound, parsed, and checked in one place.

JSON and TOML say nothing of what a document must hold. A schema is a tree of the small classes
below; `check` walks a document beside it and names the first thing that is not as it must be:

    Table({"name": Text(), "at": Mapping(Number())}, {"averaged": Flag()})
"""

import json
import os
import stat
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

__all__ = [
    "ENCODING",
    "LARGEST_DOCUMENT",
    "Flag",
    "ListOf",
    "Mapping",
    "Maybe",
    "Number",
    "OneOf",
    "Schema",
    "Table",
    "Text",
    "Whole",
    "check",
    "meant",
    "parse_json",
    "parse_toml",
    "read_bytes",
    "read_json",
]

LARGEST_DOCUMENT = 64 << 20
_LARGEST_FILE = 4 << 30
# No quantity of this program is larger, and squares of these are finite.
_LARGEST_NUMBER = 1e100
_SHOWN = 60
ENCODING = "utf-8-sig"
"""Of text that people write: some editors put a mark before it, which is skipped in Rust, too."""


class Schema(Protocol):
    """What a value must be."""

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns place, value and what is allowed of the first thing that is wrong, or None."""
        ...


@dataclass(frozen=True)
class Text:
    """Text; one of `choices` if there are any."""

    choices: tuple[str, ...] = ()

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        if not isinstance(value, str):
            return at, value, "text"
        if self.choices and value not in self.choices:
            return at, value, f"one of {', '.join(self.choices)}"
        return None


@dataclass(frozen=True)
class Flag:
    """True or false; text is neither."""

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        return None if isinstance(value, bool) else (at, value, "true or false")


@dataclass(frozen=True)
class Number:
    """A finite number between two bounds."""

    low: float = -_LARGEST_NUMBER
    high: float = _LARGEST_NUMBER

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        # Whole numbers of any length are not floats, and NaN is between no bounds.
        if is_number and self.low <= value <= self.high and isfinite(value):
            return None
        return at, value, f"a number from {self.low:g} to {self.high:g}"


@dataclass(frozen=True)
class Whole:
    """A whole number between two bounds."""

    low: int = 0
    high: int = 2**63 - 1

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        is_whole = isinstance(value, int) and not isinstance(value, bool)
        if is_whole and self.low <= value <= self.high:
            return None
        return at, value, f"a whole number from {self.low} to {self.high}"


@dataclass(frozen=True)
class ListOf:
    """A list of one kind of thing."""

    item: Schema
    least: int = 0

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        if not isinstance(value, list) or len(value) < self.least:
            return at, value, f"a list of at least {self.least}" if self.least else "a list"
        for i, item in enumerate(value):
            if (fault := self.item.fault(item, f"{at}[{i}]")) is not None:
                return fault
        return None


@dataclass(frozen=True)
class Mapping:
    """A table of any names, each with one kind of thing."""

    value: Schema

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        if not isinstance(value, dict):
            return at, value, "a table"
        for key, item in value.items():
            if (fault := self.value.fault(item, _below(at, key))) is not None:
                return fault
        return None


@dataclass(frozen=True)
class Table:
    """A table of these names; others are allowed if `open`."""

    needed: dict[str, Schema]
    optional: dict[str, Schema] = field(default_factory=dict)
    open: bool = False

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        if not isinstance(value, dict):
            return at, value, "a table"
        known = {**self.needed, **self.optional}
        listed = f"it has {', '.join(self.needed) or 'nothing'}"
        if self.optional:
            listed += f" and may have {', '.join(self.optional)}"
        for key, item in value.items():
            # Before what is missing: most often it is that, misspelt.
            if key not in known and not self.open:
                return (
                    _below(at, key),
                    item,
                    f"absent, for it is unknown{meant(key, known)}: {listed}",
                )
        for key in self.needed:
            if key not in value:
                return _below(at, key), None, f"there: {listed}"
        for key, item in value.items():
            if key in known and (fault := known[key].fault(item, _below(at, key))) is not None:
                return fault
        return None


def meant(word: str, known: Iterable[str]) -> str:
    """Returns which of the `known` words an unknown one is most like, in brackets; "" if none."""
    near = get_close_matches(word, list(known), n=1)
    return f" (is it {near[0]}?)" if near else ""


@dataclass(frozen=True)
class Maybe:
    """A thing, or null."""

    some: Schema

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong."""
        return None if value is None else self.some.fault(value, at)


@dataclass(frozen=True)
class OneOf:
    """Any of several things."""

    kinds: tuple[Schema, ...]

    def fault(self, value: Any, at: str) -> tuple[str, Any, str] | None:
        """Returns what is wrong with the last of them, if with all.

        A table or a list that one of them could be has its fault within: that is told first.
        """
        faults = []
        for kind in self.kinds:
            fault = kind.fault(value, at)
            if fault is None:
                return None
            faults.append(fault)
        within = [fault for fault in faults if fault[0] != at]
        return (within or faults)[-1]


def check(
    document: Any, schema: Schema, where: Path | str, *, error: type[ValueError] = ValueError
) -> None:
    """Checks a document.

    Raises:
        ValueError: of the kind `error`; names the file, the place, what was found and what is
            allowed.
    """
    fault = schema.fault(document, "")
    if fault is not None:
        at, found, allowed = fault
        shown = repr(found)
        shown = shown if len(shown) <= _SHOWN else shown[: _SHOWN - 3] + "..."
        raise error(f"{where}: {at or 'the document'} must be {allowed}, got {shown}")


def read_bytes(path: str | os.PathLike[str], *, most: int = _LARGEST_FILE) -> bytes:
    """Returns the bytes of a plain file of at most `most`.

    Raises:
        TypeError: no path; a number would be a file that is open already.
        OSError: it cannot be read.
        ValueError: a folder, a device or a pipe, or a larger file.
    """
    os.fspath(path)
    if not stat.S_ISREG(os.stat(path).st_mode):
        kind = "a folder" if os.path.isdir(path) else "a device or pipe"
        raise ValueError(f"{path}: the file must be a plain file, found {kind}")
    with open(path, "rb") as file:
        data = file.read(most + 1)
    if len(data) > most:
        raise ValueError(f"{path}: the file must have at most {most} bytes, found more")
    return data


def parse_json(data: bytes, where: Path | str, *, error: type[ValueError] = ValueError) -> Any:
    """Returns the JSON in `data`; NaN, infinities and endless nesting are none.

    Raises:
        ValueError: of the kind `error`; names the file.
    """

    def refuse(word: str) -> Any:
        raise ValueError(f"{word} is no number")

    try:
        return json.loads(data.decode(ENCODING), parse_constant=refuse)
    except RecursionError:
        raise error(f"{where} is nested too deeply") from None
    except ValueError as reason:
        raise error(f"{where} is truncated or not JSON: {reason}") from None


def read_json(path: str | os.PathLike[str], schema: Schema) -> Any:
    """Returns the checked JSON of a file.

    Raises:
        OSError: it cannot be read.
        ValueError: it is not JSON, or not what the schema says; names the file.
    """
    where = Path(path)
    document = parse_json(read_bytes(where, most=LARGEST_DOCUMENT), where)
    check(document, schema, where)
    return document


def parse_toml(data: bytes, where: Path | str, *, error: type[ValueError] = ValueError) -> Any:
    """Returns the TOML in `data`.

    Raises:
        ValueError: of the kind `error`; names the file.
    """
    try:
        return tomllib.loads(data.decode(ENCODING))
    except RecursionError:
        raise error(f"{where} is nested too deeply") from None
    except ValueError as reason:
        raise error(f"{where}: not valid TOML: {reason}") from None


def _below(at: str, key: object) -> str:
    return f"{at}.{key}" if at else str(key)
