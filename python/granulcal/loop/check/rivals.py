r"""Which models are within reach of a name: their evidence has an error of its own.

An effect of the image is read from images that are poured anyway, and what it does is well known;
what a poured effect does is known from its share of the archive, and the surrogate's error U of it
spreads its evidence thin. So an effect that is cheap to know may pass for one that is true. With V
the covariance of a model and $V_0$ that without effects,

$$ \log Z_A + \frac12 \log \frac{|V_A|}{|V_0|} $$

is its evidence at the mean that suits it best within U, paid for by how far that is from the
surrogate's, as if it were known as the base model is. A model that is by this no less probable than
a name, but for the nats that tell rivals apart, is within reach of it. Nothing but its own pours
says whether it gets there (`rival_rounds.py`, `weigh.py`).

Reference:
    MacKay, Information theory, inference and learning algorithms, 2003, chapter 28.
    Auer, Cesa-Bianchi and Fischer, Finite-time analysis of the multiarmed bandit problem, Machine
    Learning 47, 2002: what is unsure is tried as if it were as good as it may be.
"""

from collections.abc import Sequence
from dataclasses import replace

from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Explanation, Trace
from granulcal.loop.test.verdict import Verdict, families_of

__all__ = ["as_named", "families_in", "within_reach"]

# Rivals of a name that are poured, those that reach farthest first.
_MOST = 3


def within_reach(found: Trace, rules: Thresholds) -> list[Explanation]:
    """Returns the rivals of the name that pours could make as probable, at most `_MOST`.

    None of its families is a rival, nor is what has a further effect beside it: a second effect is
    asked of what the first one's pours leave.
    """
    best = found.best
    if best is found.base:
        return []
    kin, floor = set(families_in(found, best.effects)), best.log_probability - rules.rivals
    rivals: list[tuple[float, Explanation]] = []
    for one, model in zip(found.explanations, found.models, strict=True):
        if len(one.effects) > len(best.effects) or as_named(found, one).best is not one:
            continue
        reach = one.log_probability + model.unsure
        if reach > floor and set(families_in(found, one.effects)) != kin:
            rivals.append((reach, one))
    return [one for _, one in sorted(rivals, key=lambda pair: -pair[0])[:_MOST]]


def as_named(found: Trace, one: Explanation) -> Trace:
    """Returns the trace as if this model were named."""
    kin = families_in(found, one.effects)
    kind = "EFFECT" if len(kin) == 1 else "EFFECTS"
    return replace(found, verdict=Verdict(kind, one.effects, kin, found.verdict.p, ""))


def families_in(found: Trace, names: Sequence[str]) -> tuple[str, ...]:
    """Returns the families of effects, parallel ones with the first of their group."""
    design = found.local.surrogate.design
    known = [effect.name for effect in design.effects]
    merged = [tuple(known.index(name) for name in group) for group in found.power.families]
    return families_of(design, tuple(known.index(name) for name in names), merged)
