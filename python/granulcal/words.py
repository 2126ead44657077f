"""Words that were misspelt."""

import difflib
from collections.abc import Iterable

__all__ = ["did_you_mean", "not_there"]


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """Returns the end of a message that asks for the nearest known word; empty if none is near."""
    near = difflib.get_close_matches(word, list(known), n=1)
    return f"; did you mean {near[0]}?" if near else ""


def not_there(word: str, what: str, built_in: Iterable[str]) -> str:
    """Returns what is to be said of a word that is neither a file nor the name of a built-in."""
    known = list(built_in)
    names = ", ".join(known)
    return f"{word!r} is no file and no built-in {what} ({names}){did_you_mean(word, known)}"
