"""A number of the scene on the command line, `--set PATH=NUMBER`."""

import argparse
import math
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from granulcal.design.posterior_file import PosteriorDraws

__all__ = ["require_apart", "setting"]


def setting(text: str) -> tuple[str, float]:
    """Returns path and number of PATH=NUMBER.

    Raises:
        argparse.ArgumentTypeError: not of that form, or no finite number.
    """
    path, mark, value = text.partition("=")
    if not mark or not path:
        raise argparse.ArgumentTypeError(f"must be PATH=NUMBER, got {text!r}")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(
            f"{path} must be a number, as in {path}=0.5: --set takes numbers alone; got {value!r}"
        )
    return path, number


def require_apart(
    settings: Sequence[tuple[str, float]],
    draws: "PosteriorDraws",
    file: "Path",
    *,
    besides: Collection[str] = (),
) -> None:
    """Refuses `--set` of a number that the posterior states too, which would be taken in its place.

    Args:
        settings: paths and numbers.
        draws: the posterior.
        file: of it.
        besides: paths that are not taken from the posterior.

    Raises:
        ValueError: names the path.
    """
    for path, _ in settings:
        if path in (*draws.names, *draws.fixed) and path not in besides:
            raise ValueError(
                f"--set {path}: the posterior {file} states it, too, and its number would be taken; "
                "leave out one of both"
            )
