"""Whether recordings are inside the model, as words of the command line tell it."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granulcal.bayessim.check.misfit import Misfit

__all__ = ["odd_pour_of", "print_misfit"]


def print_misfit(misfit: "Misfit", recordings: Sequence[object]) -> None:
    """Prints it, and which of the recordings an odd pour is of."""
    print(misfit)
    if odd := misfit.odd_pour:
        print(f"  pour {odd.number} is {recordings[odd.number - 1]}")


def odd_pour_of(misfit: "Misfit") -> dict[str, Any] | None:
    """Returns the odd pour for JSON; None if there is none."""
    return asdict(misfit.odd_pour) if misfit.odd_pour else None
