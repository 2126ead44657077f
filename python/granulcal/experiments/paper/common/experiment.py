"""One experiment of the paper: what it asks, what it pours, how it is made."""

from collections.abc import Callable
from dataclasses import dataclass

from granulcal.experiments.paper.common.outcome import Outcome
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Workshop

__all__ = ["Experiment"]


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """One experiment of the paper.

    Attributes:
        number: its place in the list.
        name: how the command line calls it.
        title: its heading.
        section: the section of the paper.
        asks: what it asks, in a sentence.
        run: makes it.
        sets: the sets of pours that it rests on, of which it may share some with others.
    """

    number: int
    name: str
    title: str
    section: str
    asks: str
    run: Callable[[Workshop], Outcome]
    sets: Callable[[Size], list[PouredSet]]
