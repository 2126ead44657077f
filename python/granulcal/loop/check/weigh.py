"""A name and its rivals, each by its own pours.

What rounds of pours have left within reach of a name (`rivals.py`) is poured as the name is, at its
fit and a step from it (`placed.py`), and all are weighed by these pours alone (`by_pours.py`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.by_pours import ByPours, log_evidence
from granulcal.loop.check.placed import Placed, placed
from granulcal.loop.check.rivals import as_named, families_in, within_reach
from granulcal.loop.check.settle import Settled
from granulcal.loop.pours.replicates import FEWEST, ModelPours, pours_of
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Explanation, Trace
from granulcal.loop.test.verdict import Verdict

__all__ = ["Weighed", "judged", "weigh"]

Array = NDArray[np.float64]


class Weighed(NamedTuple):
    """A model and what its own pours say of the data.

    Attributes:
        fitted: the model where the surrogate has it.
        placed: the model where its pours put it.
        said: how probable that is.
    """

    fitted: Explanation
    placed: Placed
    said: ByPours


def weigh(
    analysis: Analysis, settled: Settled, there: Placed, measured: dict[str, Array]
) -> list[Weighed]:
    """Returns the name and its rivals by their own pours, the most probable first.

    Empty where none is within reach, none can be poured, or the base model's pours leave too little
    for a name.

    Args:
        analysis: task and pours.
        settled: the surrogate, what it says, pours of the base model and of the name.
        there: the name where its pours put it.
        measured: statistics under each condition to fit, by name.
    """
    found, surrogate, of_base = settled.trace, settled.surrogate, there.of_base
    if there.own is None or of_base is None or of_base.residual_test.p > analysis.rules.name:
        return []
    rivals = within_reach(found, analysis.rules)
    if not rivals:
        return []
    weighed = [_weighed(analysis, surrogate, found.best, there, measured)]
    for rival in rivals:
        named = as_named(found, rival)
        simulated = {
            c.name: ModelPours(
                settled.simulated[c.name].base,
                pours_of(analysis.forward, analysis.task, c, named.best, settled.seed),
            )
            for c in analysis.fitted
        }
        if min(len(two.augmented) for two in simulated.values()) < FEWEST:
            continue
        put = placed(analysis, surrogate, named, measured, simulated)
        weighed.append(_weighed(analysis, surrogate, named.best, put, measured))
    if len(weighed) == 1:
        return []
    weighed.sort(key=lambda w: -w.said.log_probability)
    told = [f"{_name(w)} {-_gap(weighed[0], w):.1f} nat (p = {w.said.p:.3g})" for w in weighed]
    analysis.say(f"the name and its rivals, each by its own pours: {', '.join(told)}")
    return weighed


def judged(found: Trace, weighed: Sequence[Weighed], rules: Thresholds) -> Verdict:
    """Returns the verdict of models by their own pours; that of the fits where none is adequate.

    Of those whose pours leave nothing, singles within `rivals` of the most probable one are not
    distinguished; a pair that is no more probable by as much gives way to a single effect.
    """
    adequate = [w for w in weighed if w.said.p > rules.adequate]
    if not adequate:
        return found.verdict
    singles = [w for w in adequate if len(w.fitted.effects) == 1]
    lead = next((w for w in singles if _gap(adequate[0], w) <= rules.rivals), adequate[0])
    is_pair = len(lead.fitted.effects) > 1
    near = [lead] if is_pair else [w for w in singles if _gap(lead, w) <= rules.rivals]
    names = tuple(name for w in near for name in w.fitted.effects)
    kin = families_in(found, names)
    if len(found.best.effects) == 1 and found.best.effects[0] in names:
        # Of one family with what is named, or not weighed.
        asked = {w.fitted.effects for w in weighed}
        names += tuple(
            name
            for name in found.verdict.named
            if name not in names and (families_in(found, (name,))[0] in kin or (name,) not in asked)
        )
        kin = families_in(found, names)
    if set(names) == set(found.verdict.named) and lead.fitted is found.best:
        names = found.verdict.named
    kind = "EFFECT" if len(kin) == 1 else "EFFECTS" if is_pair else "SET"
    others = ", ".join(
        f"{_name(w)} by {_gap(lead, w):.1f} nat"
        if w.said.p > rules.adequate
        else f"{_name(w)}, whose pours leave something (p = {w.said.p:.3g})"
        for w in weighed
        if not set(w.fitted.effects) <= set(names)
    )
    why = f"log probability {lead.fitted.log_probability:.1f} nat above that of no effect"
    why += f"; by their own pours told from {others}" if others else ""
    why += "; their own pours do not tell these apart" if kind == "SET" else ""
    return Verdict(kind, names, kin, found.verdict.p, why)


def _name(one: Weighed) -> str:
    return " + ".join(one.fitted.effects)


def _gap(one: Weighed, other: Weighed) -> float:
    """How much more probable `one` is than `other` [nat]."""
    return one.said.log_probability - other.said.log_probability


def _weighed(
    analysis: Analysis,
    surrogate: Surrogate,
    one: Explanation,
    put: Placed,
    measured: dict[str, Array],
) -> Weighed:
    found = put.trace
    model = found.model_of(found.best)
    fresh = analysis.observed({name: two.augmented for name, two in put.simulated.items()})
    seen = analysis.observed(measured)
    log_z = log_evidence(surrogate, found.base_fit, model.fit, seen, fresh)
    share = model.log_probability - model.log_evidence
    p = 0.0 if put.own is None else put.own.residual_test.p
    return Weighed(one, put, ByPours(one.effects, log_z + share, p))
