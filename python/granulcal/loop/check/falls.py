"""What may take the word of the fits away, one function for each row of `standing.py`'s table.

Each returns the word in its place, or None where it has nothing against it.
"""

from collections.abc import Sequence
from dataclasses import replace

from granulcal.loop.check.moved import Moved, overturned
from granulcal.loop.check.recentre import Recentred
from granulcal.loop.check.unseen import Seen
from granulcal.loop.test.distance import Improvement
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = [
    "as_far_as_poured",
    "by_definitions",
    "by_distance",
    "by_draws",
    "by_error",
    "by_own_pours",
    "by_sealed",
    "by_surrogate",
    "left_by_base",
]

LEFT = 1.0
"""Most D² for each statistic, in squared spreads of the archive, that a named model may leave."""


def left_by_base(before: Verdict, of_base: Recentred | None, rules: Thresholds) -> Verdict:
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


def by_definitions(
    before: Verdict, word: Verdict, moved: Sequence[Moved], rules: Thresholds
) -> Verdict | None:
    """OVERTURNED where another definition of what is measured contradicts the word."""
    against = [one for one in moved if overturned(word, one.verdict, rules.name)]
    if not against:
        return None
    words = ", ".join(f"{one.verdict.kind} under {one.definition}" for one in against)
    return _fallen("OVERTURNED", before, words)


def by_draws(before: Verdict, nearer: Improvement | None) -> Verdict | None:
    """UNCONFIRMED where a random draw of the model is nearer to the data than its fit."""
    if nearer is None or not nearer.is_worse:
        return None
    off, best = nearer.total_after.square, nearer.total_before.square
    why = (
        f"a random draw of the model is nearer to the data than its fit (D² {best:.3g}, {off:.3g})"
    )
    return _fallen("UNCONFIRMED", before, why)


def by_error(before: Verdict, word: Verdict, error: Improvement | None) -> Verdict | None:
    """UNCONFIRMED where the base model is nearer: it is the same with strengths of 0."""
    if word.kind not in NAMING or error is None or not error.is_worse:
        return None
    off, base = error.total_after.square, error.total_before.square
    why = f"the base model is nearer to the data (D² {base:.3g}, {off:.3g})"
    return _fallen("UNCONFIRMED", before, why)


def by_sealed(
    before: Verdict, word: Verdict, sealed: Improvement | None, *, is_off: bool = False
) -> Verdict | None:
    """UNCONFIRMED where the base model is nearer to what no fit has seen.

    Args:
        before: the verdict of the fits.
        word: what is left of it.
        sealed: from the base model to the verdict's, sealed conditions.
        is_off: whether these have own errors that nobody knows: they are in neither model's pours,
            and pass for the better or the worse of one.
    """
    if word.kind not in NAMING or sealed is None or is_off or not sealed.is_worse:
        return None
    off, base = sealed.total_after.square, sealed.total_before.square
    why = (
        "at the sealed conditions, which no fit has seen, the base model is nearer to the data "
        f"(D² {base:.3g}, {off:.3g})"
    )
    return _fallen("UNCONFIRMED", before, why)


def by_distance(
    before: Verdict, word: Verdict, error: Improvement | None, size: int
) -> Verdict | None:
    """UNEXPLAINED far from all pours, which scatter so much there that a test finds nothing."""
    if word.kind not in NAMING or error is None:
        return None
    if not error.total_after.interval[0] > LEFT * size:
        return None
    left = error.total_after.square
    why = (
        f"the pours are far from those of every model: with it D² is still {left:.3g}, more "
        f"than {LEFT:g} squared spread of the archive in each of {size} statistics; are the "
        "conditions' numbers in the scene's units?"
    )
    return _fallen("UNEXPLAINED", before, why)


def by_own_pours(
    before: Verdict,
    word: Verdict,
    is_word_left: bool,
    own: Recentred | None,
    of_base: Recentred | None,
    rules: Thresholds,
) -> Verdict | None:
    """RESIDUAL or UNCONFIRMED where the model's own pours at its fit leave something."""
    least = {"NONE": rules.name, **dict.fromkeys(NAMING, rules.adequate)}.get(word.kind, 0.0)
    pours = own if word is before else of_base
    if pours is None or pours.residual_test.p > least:
        return None
    left = pours.residual_test.p
    why = f"its own pours at its fit leave something of the data (p = {left:.3g})"
    if is_word_left and word.kind in NAMING and of_base is not None:
        # Of the base model they have left something, or there were no name.
        of_none = of_base.residual_test.p
        return _fallen("RESIDUAL", before, f"{why}, as the base model's do (p = {of_none:.3g})")
    return _fallen("UNCONFIRMED", before, why)


def by_surrogate(before: Verdict, confirmed: float, rules: Thresholds) -> Verdict | None:
    """UNCONFIRMED where the surrogate is wrong at the fit, or nobody can tell."""
    if confirmed > rules.confirm:
        return None
    why = (
        "no fresh pour of its model is usable"
        if confirmed != confirmed
        else f"the surrogate is wrong at its fit (p = {confirmed:.3g} of fresh pours)"
    )
    return _fallen("UNCONFIRMED", before, why)


def as_far_as_poured(verdict: Verdict, seen: Sequence[Seen]) -> Verdict:
    """The verdict; UNEXPLAINED says which effects had no usable pour, and may still explain it."""
    lacking = ", ".join(f"{one.effect} {one.lacks}" for one in seen if one.lacks)
    if verdict.kind != "UNEXPLAINED" or not lacking:
        return verdict
    return replace(
        verdict,
        reason=f"{verdict.reason}, as far as it has pours: none usable of {lacking}, which may "
        "still explain it",
    )


def _fallen(kind: str, before: Verdict, why: str) -> Verdict:
    return Verdict(kind, (), (), before.p, f"{_said(before)}, but {why}")


def _said(verdict: Verdict) -> str:
    named = f" {', '.join(verdict.named)}" if verdict.named else ""
    return f"the fits say {verdict.kind}{named}"
