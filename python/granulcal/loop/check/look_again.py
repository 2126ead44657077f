r"""What the models' own pours teach the surrogate, where they contradict what the fits say.

    repeat
        hold the surrogate where it is wrong at the fits         (settle.py)
        place the verdict's model by its own pours               (placed.py)
        pour the rivals of a name that pours could make as probable, each at its fit (weigh.py)
        stop if the pours agree with the fits, or after `ROUNDS` rounds
        condition the surrogate on pours of the base model, of the best one and of its rivals at
            their fits, and where they were placed               (conditioned.py)
        ask everything again

A surrogate that is unsure of a model takes it for adequate where the model's own pours are not: one
effect hides a second one so. It can be unsure of the base model as well, and sees nothing where
that model's pours leave something. What the pours say at these fits the surrogate knows from then
on, and other models are held against it; where none is adequate by that, the most probable one is
poured next. The pours of the next round are fresh: no word rests on pours that the surrogate has
seen.

A name contradicts the pours as well where those of a rival are nearer to the data than its own, by
as many nats as tell rivals apart. Rivals whose pours do not tell them from the name stand beside it
(SET); after the last round the word is what the pours say.

Where no model is adequate by the archive alone, that stands: whoever looks on until something fits
names an effect of the library for one that it lacks (docs/results/loop-self.md).

Reference:
    Jones, Schonlau and Welch, Efficient global optimization of expensive black-box functions, J.
    Global Optimization 13, 1998: pours where a surrogate says that the optimum is, until it holds.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.confirm import confirm
from granulcal.loop.check.placed import Placed, placed
from granulcal.loop.check.settle import Settled, settle
from granulcal.loop.check.weigh import Weighed, judged, weigh
from granulcal.loop.pours.replicates import model_faults, model_scene, seeds_of_replicates
from granulcal.loop.pours.rows import Rows
from granulcal.loop.surrogate.baseline import Start
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.conditioned import conditioned
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Explanation, Trace, trace
from granulcal.loop.test.verdict import NAMING, Verdict

__all__ = ["ROUNDS", "Looked", "look_again"]

Array = NDArray[np.float64]

ROUNDS = 3
"""Most rounds of pours that the surrogate learns from."""
# Seeds of a round's pours, apart from those of the round before.
_ROUND_STEP = 20_000


class Looked(NamedTuple):
    """What is known once pours and fits agree.

    Attributes:
        settled: the surrogate and what it says.
        placed: the models where they are.
        rounds: of pours that the surrogate has learnt from.
        pours: of the rounds before the last, and of rivals in that.
        weighed: the name and its rivals by their own pours, the most probable first; empty where
            none was within reach.
    """

    settled: Settled
    placed: Placed
    rounds: int
    pours: int
    weighed: tuple[Weighed, ...] = ()


def look_again(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    observed: Sequence[ConditionPours],
    measured: dict[str, Array],
) -> Looked:
    """Returns the models where they are, by a surrogate that their own pours do not contradict.

    Args:
        analysis: task and pours.
        surrogate: of the archive.
        found: what it says.
        observed: pours under the conditions to fit.
        measured: their statistics, by name of the condition.
    """
    before = number = 0
    while True:
        fresh = replace(analysis, seed=analysis.seed + _ROUND_STEP * number)
        settled = settle(fresh, surrogate, found, observed)
        there = placed(fresh, settled.surrogate, settled.trace, measured, settled.simulated)
        why = _contradiction(settled.trace, there, analysis.rules)
        stands = number == ROUNDS or (number == 0 and settled.trace.verdict.kind == "UNEXPLAINED")
        weighed = [] if why and not stands else weigh(fresh, settled, there, measured)
        rivals = [w for w in weighed if w.placed is not there]
        word = judged(settled.trace, weighed, analysis.rules)
        if _best_of(settled.trace, word) is not settled.trace.best:
            why = f"{word.kind} {', '.join(word.named)} by the models' own pours"
        more = _poured(analysis, settled, there, rivals) if why and not stands else []
        if not more:
            before += sum(len(two.augmented) for w in rivals for two in w.placed.simulated.values())
            before += sum(w.placed.pours for w in rivals)
            return _said(analysis, Looked(settled, there, number, before, tuple(weighed)), word)
        number += 1
        # A step that was not taken is in none of these pours.
        aside = there.pours if there.trace is settled.trace else 0
        aside += sum(w.placed.pours for w in rivals if w.placed.trace.best is w.fitted)
        before += settled.before + aside + sum(map(len, more))
        surrogate = conditioned(settled.surrogate, Rows.joined(more))
        fits = [settled.trace.fit_of(one) for one in settled.trace.explanations[:1]]
        fits += [w.placed.trace.fit_of(w.placed.trace.best) for w in weighed[:1]]
        starts = [Start(fit.v, fit.psi) for fit in fits]
        found = trace(surrogate, observed, analysis.rules, seed=analysis.seed, starts=starts)
        analysis.say(f"{why}; with these pours, {found.verdict.kind}: {found.verdict.reason}")


def _contradiction(found: Trace, there: Placed, rules: Thresholds) -> str:
    """What the models' own pours have against the word of the fits; nothing if they agree."""
    of_base, own, kind = there.of_base, there.own, found.verdict.kind
    if of_base is None or own is None or of_base.residual_test.p > rules.name:
        return ""
    p = of_base.residual_test.p
    if kind in NAMING:
        left = own.residual_test.p
        what = ", ".join(found.verdict.named)
        return f"pours of {what} leave something (p = {left:.3g})" if left <= rules.adequate else ""
    if kind == "UNEXPLAINED":
        return "no model is adequate by the surrogate"
    return f"pours of the base model leave more than the fits say (p = {p:.3g})"


def _best(found: Trace) -> Explanation:
    """The model of the verdict; where it names none, the most probable that was fitted."""
    if found.verdict.kind in NAMING or not found.explanations:
        return found.best
    return found.explanations[0]


def _best_of(found: Trace, verdict: Verdict) -> Explanation:
    """The model that the verdict would rest on."""
    return replace(found, verdict=verdict).best


def _said(analysis: Analysis, looked: Looked, word: Verdict) -> Looked:
    """The same with the word of the models' own pours, and with the model that it rests on."""
    settled, there = looked.settled, looked.placed
    if word is settled.trace.verdict:
        return looked
    held = replace(settled.trace, verdict=word)
    for one in looked.weighed:
        if one.fitted.effects == held.best.effects and one.placed is not there:
            # Its pours stand in place of the other's.
            rows = {name: two.augmented for name, two in one.placed.simulated.items()}
            fit = one.placed.trace.fit_of(one.placed.trace.best)
            confirmed = confirm(settled.surrogate, fit, analysis.observed(rows))
            settled = replace(settled, confirmed=confirmed)
            there = one.placed._replace(pours=there.pours)
    analysis.say(f"by their own pours {word.kind} {', '.join(word.named)}: {word.reason}")
    settled = replace(settled, trace=held)
    there = there._replace(trace=replace(there.trace, verdict=word))
    return looked._replace(settled=settled, placed=there)


def _poured(
    analysis: Analysis, settled: Settled, there: Placed, rivals: Sequence[Weighed]
) -> list[Rows]:
    """Pours of base model, best one and rivals at their fits, and where these were placed."""
    held, best = settled.trace, _best(settled.trace)
    models = [(held.base, settled.seed)]
    if best is not held.base:
        models.append((best, settled.seed))
    if there.trace is not held:
        models.append((there.trace.best, there.seed))
    for one in rivals:
        models.append((one.fitted, settled.seed))
        if one.placed.trace.best is not one.fitted:
            models.append((one.placed.trace.best, one.placed.seed))
    return [rows for one, of in models for rows in _rows(analysis, one, of)]


def _rows(analysis: Analysis, one: Explanation, seed: int) -> list[Rows]:
    """Pours of a model, as rows of the archive; one of the camera's lengths has none."""
    task, plan = analysis.task, analysis.plan
    if {effect.name for effect in task.library if effect.camera} & set(one.effects):
        return []
    psi = np.zeros(len(plan.design.effects))
    names = [effect.name for effect in plan.design.effects]
    psi[[names.index(name) for name in one.effects]] = one.best_strengths
    made = []
    for condition in analysis.fitted:
        scene, faults = model_scene(task, condition, one), model_faults(task, one)
        x = analysis.forward.pours(scene, seeds_of_replicates(condition, seed), faults)
        at = one.theta, plan.unit(condition.at), psi
        theta, where, strengths = (np.tile(row, (len(x), 1)) for row in at)
        made.append(Rows(theta, where, strengths, x))
    return [rows for rows in made if len(rows)]
