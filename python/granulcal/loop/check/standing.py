"""Whether a verdict stands: what may overturn it once it has been found (`falls.py`).

| check | what it asks | if it fails |
|---|---|---|
| base | its own pours leave something: p <= `detect`, for a name p <= `name` | RESIDUAL, NONE |
| surrogate | it is right at the fit, p > `confirm`, after `settle.py` at the latest | UNCONFIRMED |
| own pours | they leave nothing: p > `adequate`, for NONE > `name` | RESIDUAL, UNCONFIRMED |
| prior | no random draw of the model is nearer to the data than its fit | UNCONFIRMED |
| error | with a name the base model is not nearer to the data, by the 95 % | UNCONFIRMED |
| sealed | nor to the sealed ones, unless these may have own errors nobody knows | the same |
| distance | with a name D² is not above `LEFT` for each statistic, at 97.5 % | UNEXPLAINED |
| definitions | the same verdict with every threshold and definition moved | OVERTURNED |
| sealed rows | the named effect beats what needs no physics (`trivial.py`) | said beside the name |

A name with which D² at the sealed conditions is no less, not for certain, has this said first.
The base model's own pours are asked first, and the other checks are of the word that they leave.
Surrogate and prior hold for every word, NONE as well: nothing may be said from a fit that rests
where the surrogate is wrong. The last takes no word away, for a name may be right and yet predict
no better than a straight line; but it is said wherever the name is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from granulcal.loop.check.by_pours import ByPours
from granulcal.loop.check.falls import (
    as_far_as_poured,
    by_definitions,
    by_distance,
    by_draws,
    by_error,
    by_own_pours,
    by_sealed,
    by_surrogate,
    left_by_base,
)
from granulcal.loop.check.moved import Moved, overturned
from granulcal.loop.check.recentre import Recentred
from granulcal.loop.check.trivial import TrivialRow
from granulcal.loop.check.unseen import Seen
from granulcal.loop.test.distance import Improvement
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = ["FALLEN", "Moved", "Standing", "overturned", "stand"]

FALLEN = ("UNCONFIRMED", "OVERTURNED")
"""Words of a verdict that does not stand."""


@dataclass(frozen=True)
class Standing:
    """What the checks said.

    Attributes:
        verdict: the final one.
        before: the verdict before the checks.
        confirmed: p of fresh pours; NaN where none was usable.
        own: what the model's own pours at its fit say of the data; None where too few are usable.
        of_base: the same of the base model.
        anchors: rounds of fresh pours that the surrogate was held by.
        looked: rounds of pours that contradicted the fits, from which the surrogate has learnt.
        weighed: the name and its rivals by their own pours.
        draws: random draws of the model that were poured.
        nearer: D^2 of the best draw less that of the fit, with 95 %; None where neither was poured.
        moved: verdicts under the other definitions.
        trivial: rows of sealed conditions that need no physics.
        sealed: error before and after at the sealed conditions; None without any.
    """

    verdict: Verdict
    before: Verdict
    confirmed: float
    draws: int
    nearer: Improvement | None
    moved: tuple[Moved, ...]
    trivial: tuple[TrivialRow, ...]
    own: Recentred | None = None
    of_base: Recentred | None = None
    anchors: int = 0
    looked: int = 0
    weighed: tuple[ByPours, ...] = ()
    sealed: Improvement | None = None

    @property
    def stands(self) -> bool:
        """Whether no check has taken the word away."""
        return self.verdict.kind not in FALLEN

    @property
    def surrogate_p(self) -> float | None:
        """P of the fits, where that of the base model's own pours decided; else None."""
        p, before = self.verdict.p, self.before.p
        is_of_base = self.of_base is not None and p == self.of_base.residual_test.p
        return before if is_of_base and p != before else None

    @property
    def unbeaten(self) -> tuple[str, ...]:
        """Rows without physics that the named effect does not beat at the sealed conditions."""
        if self.before.kind not in NAMING:
            return ()
        return tuple(row.name for row in self.trivial if not row.is_beaten)

    @property
    def is_no_nearer(self) -> bool:
        """Whether a name takes nothing of an error away at the sealed conditions.

        Where there is none, none can be taken away.
        """
        if self.verdict.kind not in NAMING or self.sealed is None:
            return False
        return self.sealed.total_after.square >= self.sealed.total_before.square > 0

    def beside(self, model: str) -> str:
        """Returns in words which rows without physics the model does not beat, or is beaten by."""
        nearer = [row.name for row in self.trivial if row.is_nearer and row.name in self.unbeaten]
        others = [name for name in self.unbeaten if name not in nearer]
        words = [f"{' and '.join(nearer)} {'are' if len(nearer) > 1 else 'is'} nearer than {model}"]
        return "; ".join(
            words * bool(nearer) + [f"{model} does not beat {' nor '.join(others)}"] * bool(others)
        )

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "stands": self.stands,
            "verdict_before_checks": self.before.kind,
            "p_before_checks": self.before.p,
            "confirmed_p": None if self.confirmed != self.confirmed else self.confirmed,
            "anchors": self.anchors,
            "looked_again": self.looked,
            "rivals_by_pours": [one.to_dict() for one in self.weighed],
            "own_pours": None if self.own is None else self.own.to_dict(),
            "base_pours_p": None if self.of_base is None else self.of_base.residual_test.p,
            "random_draws": self.draws,
            "fit_less_best_draw": None if self.nearer is None else -self.nearer.gain,
            "definitions": [one.to_dict() for one in self.moved],
            "sealed_rows": [row.to_dict() for row in self.trivial],
            "not_beaten": list(self.unbeaten),
        }


def stand(
    before: Verdict,
    rules: Thresholds,
    *,
    confirmed: float,
    anchors: int = 0,
    looked: int = 0,
    weighed: Sequence[ByPours] = (),
    own: Recentred | None = None,
    of_base: Recentred | None = None,
    draws: int = 0,
    nearer: Improvement | None = None,
    error: Improvement | None = None,
    sealed: Improvement | None = None,
    is_sealed_off: bool = False,
    size: int = 16,
    moved: Sequence[Moved] = (),
    trivial: Sequence[TrivialRow] = (),
    seen: Sequence[Seen] = (),
) -> Standing:
    """Returns the final verdict.

    Args:
        before: the verdict of the fits.
        rules: what was fixed beforehand.
        confirmed: p of fresh pours of the verdict's model; NaN counts as failed.
        anchors: rounds of fresh pours that the surrogate was held by.
        looked: rounds of pours that contradicted the fits.
        weighed: the name and its rivals by their own pours, where any was within reach.
        own: what the last of these pours say of the data.
        of_base: what fresh pours of the base model say of them.
        draws: random draws that were poured.
        nearer: from the best of them (before) to the fit (after), conditions to fit.
        error: from the base model (before) to the verdict's (after), conditions to fit.
        sealed: the same of the sealed conditions.
        is_sealed_off: whether these have own errors that nobody knows.
        size: statistics of that error.
        moved: verdicts under other definitions.
        trivial: rows of the sealed conditions.
        seen: pours of each effect.
    """
    word = left_by_base(before, of_base, rules)
    # Each may take the word away, the last has the last say.
    verdict = by_definitions(before, word, moved, rules) or word
    verdict = by_draws(before, nearer) or verdict
    verdict = by_sealed(before, word, sealed, is_off=is_sealed_off) or verdict
    verdict = by_error(before, word, error) or verdict
    verdict = by_distance(before, word, error, size) or verdict
    verdict = by_own_pours(before, word, verdict is word, own, of_base, rules) or verdict
    verdict = by_surrogate(before, confirmed, rules) or verdict
    verdict = as_far_as_poured(verdict, seen)
    found = Standing(
        verdict=verdict,
        before=before,
        confirmed=confirmed,
        draws=draws,
        nearer=nearer,
        moved=tuple(moved),
        trivial=tuple(trivial),
        own=own,
        of_base=of_base,
        anchors=anchors,
        looked=looked,
        weighed=tuple(weighed),
        sealed=sealed,
    )
    reason = verdict.reason
    if verdict.kind in NAMING and found.unbeaten:
        reason = f"{reason}; at the sealed conditions {found.beside('it')}"
    if sealed is not None and found.is_no_nearer:
        # Who reads one sentence reads the first.
        reason = f"{_no_nearer(verdict, sealed)}; {reason}"
    if reason == verdict.reason:
        return found
    return replace(found, verdict=replace(verdict, reason=reason))


def _no_nearer(verdict: Verdict, sealed: Improvement) -> str:
    # Of a set the model is the most probable member's.
    named = verdict.named[:1] if verdict.kind == "SET" else verdict.named
    off, base = sealed.total_after.square, sealed.total_before.square
    low, high = sealed.gain_interval
    return (
        f"at the sealed conditions D² is {off:.3g} with {' and '.join(named)} and {base:.3g} "
        f"without (95 % of what that takes away: {low:.3g} to {high:.3g})"
    )
