"""What the simulator's half must know of the other commands: for help, completions, suggestions."""

import argparse
import json
import sys
from typing import Any, NoReturn

from granulcal.words import did_you_mean

__all__ = ["Parser", "describe"]


class Parser(argparse.ArgumentParser):
    """An argument parser that asks `did you mean` when an option is misspelt."""

    def parse_known_args(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, args: Any = None, namespace: Any = None
    ) -> Any:
        """Parses, and keeps the words for a message about them."""
        self._words = sys.argv[1:] if args is None else list(args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        """Ends with the message, and the option that is nearest to what was not known."""
        _, mark, unknown = message.partition("unrecognized arguments: ")
        if mark:
            actions = self._of_words()._actions
            known = [word for action in actions for word in action.option_strings]
            for word in unknown.split():
                message += did_you_mean(word.split("=")[0], known)
        super().error(message)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """Refuses a value that is none of its choices, and asks whether the nearest was meant."""
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            error.message += did_you_mean(str(value), map(str, action.choices or ()))
            raise

    def _of_words(self) -> argparse.ArgumentParser:
        """The parser of the command, and of the command in it, that the words name."""
        parser: argparse.ArgumentParser = self
        for word in self._words:
            for action in parser._actions:
                if isinstance(action, argparse._SubParsersAction) and word in action.choices:
                    parser = action.choices[word]
                    break
        return parser


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
