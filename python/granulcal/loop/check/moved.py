"""The verdict under another definition of what is measured, and whether it contradicts."""

from dataclasses import dataclass
from typing import Any

from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = ["Moved", "overturned"]


@dataclass(frozen=True)
class Moved:
    """The verdict under another definition.

    Attributes:
        definition: its name.
        verdict: what the same pours say, defined that way.
    """

    definition: str
    verdict: Verdict

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "definition": self.definition,
            "verdict": self.verdict.kind,
            "named": list(self.verdict.named),
            "p": self.verdict.p,
        }


def overturned(verdict: Verdict, other: Verdict, name: float) -> bool:
    """Returns whether `other`, of the same pours defined otherwise, contradicts `verdict`.

    Args:
        verdict: the registered one.
        other: under a moved definition.
        name: largest p at which something may be named.
    """
    if verdict.kind in NAMING:
        # What is parallel, and counts as one family, is another under each definition.
        both = ({*one.families, *one.named} for one in (verdict, other))
        return not set.intersection(*both)
    if verdict.kind == "NONE":
        return other.p <= name
    return other.kind == "NONE"
