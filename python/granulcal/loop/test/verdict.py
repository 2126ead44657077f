"""From p-values and evidences to one of six words; `standing.py` has what may overturn them.

| word | when |
|---|---|
| NONE | no rejection: p > `detect`; the table of detectable strengths says what could hide |
| RESIDUAL | something is left (p <= `detect`), too unsure for a name: none is within `rivals` |
| EFFECT | every adequate model within `rivals` of the best is of one family |
| SET | several families are |
| EFFECTS | the best adequate model needs two effects: first the one that is more probable alone |
| UNEXPLAINED | p <= `name`, and no model of one or two effects leaves nothing |

A second effect has to be told from none as a first one has: a pair that is not `rivals` nat more
probable than its better member alone gives way to that one, which has to be told from none itself.
What the member leaves is then asked of its own pours (`standing.py`).
"""

from dataclasses import dataclass
from math import inf

from granulcal.loop.effects.design import Design
from granulcal.loop.test.refit import Model, by_probability
from granulcal.loop.test.residual_test import ResidualTest
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["KINDS", "NAMING", "Verdict", "decide", "families_of"]

NAMING = ("EFFECT", "SET", "EFFECTS")
"""Words that come with names."""

KINDS = ("NONE", "RESIDUAL", *NAMING, "UNEXPLAINED", "UNCONFIRMED", "OVERTURNED")
"""All words; the last two are those of a verdict that a check has taken away."""


@dataclass(frozen=True)
class Verdict:
    """What may be said.

    Attributes:
        kind: one of `KINDS`.
        named: effects of the finding, the most probable first; for SET all that are not
            distinguished; else none.
        families: of `named`, each once.
        p: of the residual test before any effect was fitted; of that of the base model's own pours
            where these decided.
        reason: one sentence with the numbers that decided.
    """

    kind: str
    named: tuple[str, ...]
    families: tuple[str, ...]
    p: float
    reason: str


def decide(
    design: Design,
    test: ResidualTest,
    none: Model | None,
    models: list[tuple[Model, float]],
    thresholds: Thresholds,
    merged: list[tuple[int, ...]] | None = None,
) -> Verdict:
    """Returns the verdict.

    Args:
        design: names and families.
        test: of the fit without effects.
        none: the model without effects, if any was fitted.
        models: fitted models, each with the p of what it leaves.
        thresholds: what was fixed beforehand.
        merged: groups of effects whose directions are parallel; each counts as one family.
    """
    p = test.p
    if p > thresholds.detect:
        why = f"nothing is left of the base fit (p = {p:.3g} > {thresholds.detect:g})"
        return Verdict("NONE", (), (), p, why)
    if p > thresholds.name or not models or none is None:
        why = f"something is left (p = {p:.3g}), not below {thresholds.name:g}: no name"
        return Verdict("RESIDUAL", (), (), p, why)
    adequate = [model for model, after in models if after > thresholds.adequate]
    if not adequate:
        best = max(after for _, after in models)
        why = f"no one or two effects of the library explain it (best p after a fit {best:.3g})"
        return Verdict("UNEXPLAINED", (), (), p, why)
    best = max(adequate, key=by_probability)
    alone = {m.effects[0]: m for m, _ in models if len(m.effects) == 1}
    lead = max((alone[k] for k in best.effects if k in alone), key=by_probability, default=best)
    if best.log_probability - lead.log_probability <= thresholds.rivals:
        best = lead
    gain = best.log_probability - none.log_probability
    if gain <= thresholds.rivals:  # No effect is a rival like any other, of one of a pair as well.
        why = (
            f"something is left (p = {p:.3g}), but the best effect is not told from none: "
            f"{gain:.1f} nat of log probability, {thresholds.rivals:g} asked"
        )
        return Verdict("RESIDUAL", (), (), p, why)
    if len(best.effects) == 2:
        # The one that explains more by itself comes first.
        members = tuple(
            sorted(best.effects, key=lambda k: -by_probability(alone[k]) if k in alone else inf)
        )
        names = tuple(design.effects[k].name for k in members)
        kin = families_of(design, members, merged)
        if len(kin) == 1:
            return Verdict("EFFECT", names, kin, p, _gain(gain))
        return Verdict("EFFECTS", names, kin, p, _gain(gain))
    near = [
        model
        for model in alone.values()
        if any(model is one for one in (best, *adequate))
        and model.log_probability > best.log_probability - thresholds.rivals
    ]
    near.sort(key=by_probability, reverse=True)
    effects = tuple(model.effects[0] for model in near)
    kin = families_of(design, effects, merged)
    names = tuple(design.effects[k].name for k in effects)
    kind = "EFFECT" if len(kin) == 1 else "SET"
    return Verdict(kind, names, kin, p, _gain(gain))


def _gain(gain: float) -> str:
    return f"log probability {gain:.1f} nat above that of no effect"


def families_of(
    design: Design, effects: tuple[int, ...], merged: list[tuple[int, ...]] | None
) -> tuple[str, ...]:
    """Returns declared families, parallel effects counted with the first of their group."""
    found: list[str] = []
    for k in effects:
        first = next((group[0] for group in merged or [] if k in group), k)
        if design.family(first) not in found:
            found.append(design.family(first))
    return tuple(found)
