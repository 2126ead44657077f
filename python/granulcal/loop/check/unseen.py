"""Where an archive has no usable pour: what a range of an effect holds that no surrogate has seen.

Pours that the solver lost, that jam or that leave the view are left out of the surrogate. Where
they lie at one end of an effect's range, the fits know the effect up to there alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from granulcal.loop.pours.archive import Archive
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.parts import parts_of
from granulcal.pours.dataset import Dataset
from granulcal.pours.left_out import LeftOut

__all__ = ["Seen", "seen_of", "told_unseen"]

# Of a range, what pours drawn at random leave free at an end.
_FREE = 0.1


@dataclass(frozen=True)
class Seen:
    """The pours of one effect.

    Attributes:
        effect: its name.
        pours: that were made.
        left_out: that are not usable, by why.
        low, high: least and largest number of the usable ones, in the scene's unit; NaN of none.
        lacks: in words, the part of its range in which pours were made and none is usable.
    """

    effect: str
    pours: int
    left_out: LeftOut
    low: float
    high: float
    lacks: str

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        ends = [None if np.isnan(end) else end for end in (self.low, self.high)]
        return {
            "effect": self.effect,
            "pours": self.pours,
            "left_out": self.left_out.to_dict(),
            "usable_from": ends[0],
            "usable_to": ends[1],
            "lacks": self.lacks,
        }


def seen_of(store: Archive) -> tuple[Seen, ...]:
    """Returns what an archive has of each effect that has pours of its own."""
    plan, measures, found = store.plan, Measures.of(store.plan.scene), []
    for entry in plan.library:
        effect = entry.at(plan.scene)
        if effect.is_free or effect.held is not None:
            continue
        left_out, strengths, kept = LeftOut(), [np.empty(0)], [np.empty(0, dtype=bool)]
        for part in parts_of(plan):
            if part.effect != effect.name:
                continue
            data = Dataset.load(store.folder / part.name)
            usable = measures.of_dataset(data)[1][: part.count]
            left_out += LeftOut.of(data.status[: part.count].tolist(), usable.tolist())
            every = np.zeros(len(data), dtype=bool)
            every[: part.count] = True
            # A whole number is one of the part's scene.
            whole = np.full(len(usable), part.scene.get(effect.path)) if effect.whole else None
            psi = part.strengths(data, every, effect) if whole is None else effect.strength(whole)
            strengths.append(psi)
            kept.append(usable)
        psi, usable = np.concatenate(strengths), np.concatenate(kept)
        ends = [float("nan")] * 2
        if usable.any():
            ends = sorted(effect.value(float(f(psi[usable]))) for f in (np.min, np.max))
        lacks = []
        for sign in (-1.0, 1.0):
            if not len(psi) or (sign < 0 and not effect.is_two_sided):
                continue
            last = float((sign * psi[usable]).max()) if usable.any() else -1.0
            if 1 - last > _FREE and np.any(sign * psi[~usable] > last):
                edge = effect.value(sign * last)
                word = "above" if effect.value(sign) > edge else "below"
                unit = "" if effect.unit == "-" else f" {effect.unit}"
                lacks.append(f"{word} {edge:.3g}{unit}" if usable.any() else "anywhere")
        words = " and ".join(dict.fromkeys(lacks))
        found.append(Seen(effect.name, len(psi), left_out, ends[0], ends[1], words))
    return tuple(found)


def told_unseen(seen: Sequence[Seen]) -> tuple[str, ...]:
    """Returns a sentence for each effect a part of whose range has no usable pour."""
    return tuple(
        f"{one.effect}: {one.left_out.total} of its {one.pours} pours are left out "
        f"({one.left_out}), and none {one.lacks} is usable: nothing is known of it there"
        for one in seen
        if one.lacks
    )
