"""What the simulator's half must know of the other commands: for help, completions, suggestions."""

import argparse
import json
import re
import sys
from typing import Any, NoReturn, cast

from granulcal.words import did_you_mean

__all__ = ["Parser", "describe"]

# What argparse calls by the names of Python's types.
_NUMBERS = {"int": "a whole number", "float": "a number"}


class Parser(argparse.ArgumentParser):
    """An argument parser that asks `did you mean` when an option is misspelt."""

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, args: Any = None, namespace: Any = None
    ) -> Any:
        """Parses, and keeps the words for a message about them."""
        self._words = sys.argv[1:] if args is None else list(args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Ends with the message, and what was meant by a word that was not known."""
        _, mark, unknown = message.partition("unrecognized arguments: ")
        if mark:
            # Only the command's own parser knows how it is used.
            parser = self._of_words()
            for word in unknown.split():
                message += parser._meant(word, before=self._before(word))
            argparse.ArgumentParser.error(parser, message)
        if given := re.fullmatch(r"argument (\S+): ignored explicit argument '(.*)'", message):
            message = _takes_no_value(given[1], given[2])
        if given := re.fullmatch(r"(argument \S+): invalid (int|float) value: (.*)", message):
            message = f"{given[1]}: must be {_NUMBERS[given[2]]}, got {given[3]}"
        super().error(message)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuses a value that is none of its choices, and asks whether the nearest was meant."""
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            error.message += did_you_mean(str(value), map(str, action.choices or ()))
            raise

    def _before(self, word: str) -> str:
        """The word before another on the command line; empty if it is the first."""
        at = self._words.index(word) if word in self._words else 0
        return self._words[at - 1] if at else ""

    def _meant(self, word: str, *, before: str) -> str:
        """What is said of a word that was not known: which is near, or that the one before takes none."""
        known = {each: action for action in self._actions for each in action.option_strings}
        if word.startswith("-"):
            return did_you_mean(word.split("=")[0], known)
        takes_none = before in known and known[before].nargs == 0
        return f"; {_takes_no_value(before, word)}" if takes_none else ""

    def _of_words(self) -> "Parser":
        """The parser of the command, and of the command in it, that the words name."""
        parser = self
        for word in self._words:
            for action in parser._actions:
                if isinstance(action, argparse._SubParsersAction) and word in action.choices:
                    parser = cast(Parser, action.choices[word])
                    break
        return parser


def _takes_no_value(option: str, value: str) -> str:
    """What is said of an option that was given a value and takes none; what --json prints may go to a file."""
    told = f"{option} takes no value, got {value!r}"
    return f"{told}; to a file: {option} > {value}" if option == "--json" else told


def describe(parser: argparse.ArgumentParser, *, after_help: str) -> str:
    """Returns the JSON that `_native.run_cli` takes for `program`.

    Args:
        parser: of the whole program.
        after_help: text at the end of its help.
    """
    document = {
        "name": parser.prog,
        "after_help": after_help,
        "further": _commands(parser),
    }
    return json.dumps(document)


def _commands(parser: argparse.ArgumentParser) -> list[dict[str, Any]]:
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            abouts = {choice.dest: choice.help or "" for choice in action._choices_actions}
            return [
                {
                    "name": name,
                    "about": abouts.get(name, ""),
                    "options": _options(inner),
                    "commands": _commands(inner),
                }
                for name, inner in action.choices.items()
            ]
    return []


def _options(parser: argparse.ArgumentParser) -> list[dict[str, Any]]:
    found = []
    for action in parser._actions:
        longs = [word[2:] for word in action.option_strings if word.startswith("--")]
        shorts = [word[1:] for word in action.option_strings if len(word) == 2]
        if not longs or longs[0] == "help":
            continue
        found.append(
            {
                "long": longs[0],
                "short": shorts[0] if shorts else None,
                "help": (action.help or "").replace("%%", "%"),
                "takes_value": action.nargs != 0,
                "values": [str(value) for value in action.choices or ()],
            }
        )
    return found
