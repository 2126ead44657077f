"""Paths as arguments: each says whether it is read or written, and one place checks them all.

`type=READS` and `type=writes("model")` of an argparse argument take a path; `check` then refuses
outputs that are inputs, that would replace a file of another kind, or that cannot be written, by
the same rules as granulcal-cli's. A test walks the parser: no argument may be a plain `Path`.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from granulcal import _native
from granulcal.bayessim.storage.place import require_place
from granulcal.files import require_figure

__all__ = ["KEPT", "READS", "RECORDING", "Reads", "Writes", "actions", "check", "writes"]


@dataclass(frozen=True)
class Reads:
    """A path that is read: `file` with what it names, `recording`, or `kept` by the command."""

    kind: str

    def __call__(self, text: str) -> Path:
        """Returns the path."""
        return Path(text)


@dataclass(frozen=True)
class Writes:
    """A path that is written, of a kind that `_native.check_paths` knows."""

    kind: str

    def __call__(self, text: str) -> Path:
        """Returns the path."""
        return Path(text)


READS, RECORDING, KEPT = Reads("file"), Reads("recording"), Reads("kept")


def writes(kind: str) -> Writes:
    """Returns the type of an argument that is an output."""
    return Writes(kind)


def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Returns every argument of a parser, without those of its subcommands."""
    for action in parser._actions:
        if not isinstance(action, argparse._SubParsersAction):
            yield action


def _require_folder(path: Path) -> None:
    """Refuses a file in a folder that is not there, which is not made for it.

    Raises:
        ValueError: names the folder.
    """
    if not path.parent.is_dir():
        raise ValueError(f"the folder {path.parent} of {path} does not exist; make it first")


def check(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Checks every path that a command line names.

    Raises:
        ValueError: the message names the argument, what is wrong and what helps.
    """
    reads: list[tuple[str, Path, str]] = []
    outputs: list[tuple[str, Path, str]] = []
    for action in _given(parser, options):
        value = getattr(options, action.dest, None)
        paths = value if isinstance(value, list) else [value]
        for path in paths:
            if not isinstance(path, Path):
                continue
            if isinstance(action.type, Reads):
                reads.append((_shown(action), path, action.type.kind))
            elif isinstance(action.type, Writes):
                outputs.append((_shown(action), path, action.type.kind))
    _native.check_paths(reads, outputs)
    for argument, path, kind in outputs:
        try:
            # What writing would refuse when the work is done.
            if kind == "model":
                require_place(path)
            if kind == "figure":
                require_figure(path)
                _require_folder(path)
        except (FileExistsError, ValueError) as error:
            raise ValueError(f"{argument}: {error}") from None


def _given(
    parser: argparse.ArgumentParser, options: argparse.Namespace
) -> Iterator[argparse.Action]:
    """Arguments of the command that was chosen, and of those above it."""
    yield from actions(parser)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            chosen = action.choices.get(getattr(options, action.dest, None) or "")
            if chosen is not None:
                yield from _given(chosen, options)


def _shown(action: argparse.Action) -> str:
    long = [name for name in action.option_strings if name.startswith("--")]
    return long[0] if long else action.dest.upper()
