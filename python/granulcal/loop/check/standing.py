"""Whether a verdict stands: what may overturn it once it has been found.

| check | what it asks | if it fails |
|---|---|---|
| base | its own pours leave something: p <= `detect`, for a name p <= `name` | RESIDUAL, NONE |
| surrogate | it is right at the fit, p > `confirm`, after `settle.py` at the latest | UNCONFIRMED |
| own pours | they leave nothing: p > `adequate`, for NONE > `name` | RESIDUAL; NONE: UNCONFIRMED |
| prior | no random draw of the model is nearer to the data than its fit | UNCONFIRMED |
| error | with a name D² is not above `LEFT` for each statistic, at 97.5 % | UNEXPLAINED |
| definitions | the same verdict with every threshold and definition moved | OVERTURNED |
| sealed rows | the named effect beats what needs no physics (`trivial.py`) | said beside the name |

The base model's own pours are asked first, and the other checks are of the word that they leave.
Surrogate and prior hold for every word, NONE as well: nothing may be said from a fit that rests
where the surrogate is wrong. The last takes no word away, for a name may be right and yet predict
no better than a straight line; but it is said wherever the name is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from granulcal.loop.check.by_pours import ByPours
from granulcal.loop.check.recentre import Recentred
from granulcal.loop.check.trivial import TrivialRow
from granulcal.loop.check.unseen import Seen
from granulcal.loop.test.distance import Improvement
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = ["FALLEN", "Moved", "Standing", "overturned", "stand"]

FALLEN = ("UNCONFIRMED", "OVERTURNED")
"""Words of a verdict that does not stand."""
LEFT = 1.0
"""Most D² for each statistic, in squared spreads of the archive, that a named model may leave."""


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


def overturned(verdict: Verdict, other: Verdict, name: float) -> bool:
    """Returns whether `other`, of the same pours defined otherwise, contradicts `verdict`.

    Args:
        verdict: the registered one.
        other: under a moved definition.
        name: largest p at which something may be named.
    """
    if verdict.kind in NAMING:
        return not set(verdict.families) & set(other.families)
    if verdict.kind == "NONE":
        return other.p <= name
    return other.kind == "NONE"


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
        size: statistics of that error.
        moved: verdicts under other definitions.
        trivial: rows of the sealed conditions.
        seen: pours of each effect.
    """
    verdict = word = _left_by_base(before, of_base, rules)
    against = [one for one in moved if overturned(word, one.verdict, rules.name)]
    if against:
        words = ", ".join(f"{one.verdict.kind} under {one.definition}" for one in against)
        verdict = _fallen("OVERTURNED", before, f"{_said(before)}, but {words}")
    if nearer is not None and nearer.is_worse:
        off, best = nearer.total_after.square, nearer.total_before.square
        why = (
            "a random draw of the model is nearer to the data than its fit "
            f"(D² {best:.3g}, {off:.3g})"
        )
        verdict = _fallen("UNCONFIRMED", before, f"{_said(before)}, but {why}")
    if word.kind in NAMING and error is not None and error.is_worse:
        # The base model is the same with strengths of 0: a fit that is farther off is none.
        off, base = error.total_after.square, error.total_before.square
        why = f"the base model is nearer to the data (D² {base:.3g}, {off:.3g})"
        verdict = _fallen("UNCONFIRMED", before, f"{_said(before)}, but {why}")
    if word.kind in NAMING and error is not None and error.total_after.interval[0] > LEFT * size:
        # Far from all pours they scatter so much that the residual test finds nothing.
        left = error.total_after.square
        why = (
            f"the pours are far from those of every model: with it D² is still {left:.3g}, more "
            f"than {LEFT:g} squared spread of the archive in each of {size} statistics; are the "
            "conditions' numbers in the scene's units?"
        )
        verdict = Verdict("UNEXPLAINED", (), (), before.p, f"{_said(before)}, but {why}")
    least = {"NONE": rules.name, **dict.fromkeys(NAMING, rules.adequate)}.get(word.kind, 0.0)
    pours = own if word is before else of_base
    if pours is not None and pours.residual_test.p <= least:
        left = pours.residual_test.p
        why = f"its own pours at its fit leave something of the data (p = {left:.3g})"
        if verdict is word and word.kind in NAMING and of_base is not None:
            # Of the base model they have left something, or there were no name.
            of_none = of_base.residual_test.p
            why = f"{_said(before)}, but {why}, as the base model's do (p = {of_none:.3g})"
            verdict = Verdict("RESIDUAL", (), (), before.p, why)
        else:
            verdict = _fallen("UNCONFIRMED", before, f"{_said(before)}, but {why}")
    if not confirmed > rules.confirm:
        why = (
            "no fresh pour of its model is usable"
            if confirmed != confirmed
            else f"the surrogate is wrong at its fit (p = {confirmed:.3g} of fresh pours)"
        )
        verdict = _fallen("UNCONFIRMED", before, f"{_said(before)}, but {why}")
    lacking = ", ".join(f"{one.effect} {one.lacks}" for one in seen if one.lacks)
    if verdict.kind == "UNEXPLAINED" and lacking:
        verdict = replace(
            verdict,
            reason=f"{verdict.reason}, as far as it has pours: none usable of {lacking}, which may "
            "still explain it",
        )
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
    )
    if verdict.kind in NAMING and found.unbeaten:
        reason = f"{verdict.reason}; at the sealed conditions {found.beside('it')}"
        return replace(found, verdict=replace(verdict, reason=reason))
    return found


def _left_by_base(before: Verdict, of_base: Recentred | None, rules: Thresholds) -> Verdict:
    """The word that the base model's own pours leave: no surrogate's error may pass for physics."""
    if of_base is None or before.kind == "NONE":
        return before
    p = of_base.residual_test.p
    leaves = f"{_said(before)}, but pours of the base model at its fit leave"
    if p > rules.detect:
        return Verdict("NONE", (), (), p, f"{leaves} nothing (p = {p:.3g})")
    if p > rules.name and before.kind != "RESIDUAL":
        why = f"{leaves} too little for more (p = {p:.3g}, at most {rules.name:g} asked)"
        return Verdict("RESIDUAL", (), (), p, why)
    return before


def _fallen(kind: str, before: Verdict, why: str) -> Verdict:
    return Verdict(kind, (), (), before.p, why)


def _said(verdict: Verdict) -> str:
    named = f" {', '.join(verdict.named)}" if verdict.named else ""
    return f"the fits say {verdict.kind}{named}"
