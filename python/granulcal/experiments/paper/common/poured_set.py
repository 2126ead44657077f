"""A set of pours that an experiment rests on."""

from dataclasses import dataclass

from granulcal.pours.scene import Scene

__all__ = ["PouredSet"]


@dataclass(frozen=True)
class PouredSet:
    """Pours that an experiment makes, or finds made by another.

    Attributes:
        name: of the set, below `pours`.
        count: pours at least; further ones take the place of those that cannot be used.
        scene: what a pour costs as much as.
    """

    name: str
    count: int
    scene: Scene
