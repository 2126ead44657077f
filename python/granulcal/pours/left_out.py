"""Pours that nothing is learnt from, counted by why: unhealthy, jammed, without grains in view."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from granulcal.pours.simulate import Pour

__all__ = ["LeftOut"]

# The status `out_of_view` is of a pour of which enough is seen: it is used.
_WHY = ("unhealthy", "jammed", "no_grains_in_view")


@dataclass(frozen=True)
class LeftOut:
    """Counts of pours that cannot be used.

    Attributes:
        unhealthy: the solver lost its accuracy.
        jammed: grains remain in the funnel.
        no_grains_in_view: too few grains in view for a statistic.
        unseen: at rest and in view, but a statistic that is asked for is not a number.
    """

    unhealthy: int = 0
    jammed: int = 0
    no_grains_in_view: int = 0
    unseen: int = 0

    @classmethod
    def of(cls, status: Iterable[str], is_usable: Iterable[object]) -> "LeftOut":
        """Counts the pours that are not usable.

        Args:
            status: how each pour ended, (n,).
            is_usable: whether each is used, (n,).
        """
        counts: dict[str, int] = dict.fromkeys((*_WHY, "unseen"), 0)
        for word, kept in zip(status, is_usable, strict=True):
            if kept:
                continue
            counts[str(word) if str(word) in _WHY else "unseen"] += 1
        return cls(**counts)

    @classmethod
    def of_pours(cls, pours: "Iterable[Pour]") -> "LeftOut":
        """Counts the pours that are unhealthy or jammed."""
        status = [pour.status for pour in pours]
        return cls.of(status, [word not in _WHY for word in status])

    @property
    def total(self) -> int:
        """All of them."""
        return sum(self.to_dict().values())

    @property
    def counts(self) -> tuple[int, int, int]:
        """Unhealthy, jammed and without grains in view, as a line of progress takes them."""
        return self.unhealthy, self.jammed, self.no_grains_in_view

    def to_dict(self) -> dict[str, int]:
        """Returns the counts by name, for JSON."""
        return asdict(self)

    @property
    def advice(self) -> str:
        """What may help where pours are unhealthy, as the end of a sentence; else nothing."""
        if not self.unhealthy:
            return ""
        return (
            "; of unhealthy ones `granulcal simulate` says which bound is broken (some seeds show "
            "it), and a finer `substep` in the scene may mend it, above all where grains are small "
            "or differ in size"
        )

    def __add__(self, other: "LeftOut") -> "LeftOut":
        mine, theirs = self.to_dict(), other.to_dict()
        return LeftOut(**{name: mine[name] + theirs[name] for name in mine})

    def __str__(self) -> str:
        """In words, or `none`."""
        words = {
            "unhealthy": "unhealthy",
            "jammed": "jammed",
            "no_grains_in_view": "without grains in view",
            "unseen": "with a statistic that is no number",
        }
        found = [f"{count} {words[name]}" for name, count in self.to_dict().items() if count]
        return ", ".join(found) or "none"
