"""`close_loop`: from recordings to a verdict, with the error before and after.

The steps are those of docs/theory/loop.md: register what is fixed; fill the archive; say what could
be seen; fit and test; refit the library; decide; pour draws of the prior; pour the base and the
augmented model until the surrogate is right there and they do not contradict it; move every
definition; open the sealed conditions once, beside rows that need no physics; say the verdict; run
the placebo; write the report.
"""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.cores import cores
from granulcal.errors import ObservationError
from granulcal.files import write_beside
from granulcal.loop.analysis import Analysis
from granulcal.loop.call import check_call
from granulcal.loop.check.alarms import (
    of_base_fit,
    of_ends,
    of_error,
    of_exchange,
    of_left,
    of_placebo,
    of_prior,
    of_rows,
    of_untried,
)
from granulcal.loop.check.alone import of_alone
from granulcal.loop.check.checks import (
    calibrated,
    corrected,
    moved,
    nearer,
    trivial,
)
from granulcal.loop.check.coverage import Coverage
from granulcal.loop.check.learning import learning
from granulcal.loop.check.look_again import look_again
from granulcal.loop.check.own_errors import as_recorded, has_unknown_errors
from granulcal.loop.check.prior_rounds import ROUNDS, drawn
from granulcal.loop.check.recentre import Recentred
from granulcal.loop.check.scatter import of_scatter, scatter_of
from granulcal.loop.check.standing import stand
from granulcal.loop.check.steady import drifts
from granulcal.loop.check.unseen import seen_of, told_unseen
from granulcal.loop.closed import Closed
from granulcal.loop.effects.definitions import is_definition
from granulcal.loop.experiment import next_experiment
from granulcal.loop.pours.archive import Archive, ArchivePlan, require_same
from granulcal.loop.pours.forward import Forward
from granulcal.loop.pours.measures import Measures
from granulcal.loop.pours.refine import ROUND
from granulcal.loop.pours.replicates import (
    REPLICATES,
    both,
    error_of,
    placebo_of,
)
from granulcal.loop.pours.time_needed import time_needed
from granulcal.loop.preregistration import register
from granulcal.loop.report.folder import write_report
from granulcal.loop.report.models_of import models_of
from granulcal.loop.surrogate.condition_pours import session_numbers
from granulcal.loop.surrogate.store_surrogate import fit_surrogate
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import FIT, SEALED, Task
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Power, power, trace
from granulcal.one_thread import one_thread
from granulcal.warned import warn

__all__ = ["PAIRS", "Closed", "close_loop", "fit_surrogate", "planned"]

Array = NDArray[np.float64]

PAIRS = 20
"""Simulated pairs of a named effect, unless told otherwise."""
# Fewest pours of the base and of each effect from which a surrogate is any use.
_LEAST_BASE, _LEAST_EACH = 300, 40
# From so many on the residual test is nearly level (benches/loop_level.py).
_LEVEL_BASE, _LEVEL_EACH = 1500, 150
# Shares of a budget: the base model has more directions than any one effect.
_BASE_SHARE = 0.4


@one_thread()
def close_loop(
    task: Task,
    out: str | os.PathLike[str],
    *,
    archive: str | os.PathLike[str] | None = None,
    budget: int = 4000,
    threads: int | None = None,
    seed: int = 0,
    thresholds: Thresholds | None = None,
    surrogate: Surrogate | None = None,
    pairs: int = PAIRS,
    rounds: int = 0,
    say: Callable[[str], None] = print,
    command: str | None = None,
) -> Closed:
    """Finds what a model lacks, adds it, and tells the error before and after.

    Written to `out`: preregistration.json, verdict.json, models.json and, where `granulcal[report]`
    is installed, report.html and the tables conditions, candidates and residuals.parquet.

    Args:
        task: scene, prior, recordings.
        out: folder of the report; one that was cut off goes on.
        archive: folder of the pours, shared between analyses of one scene; `out`/archive if None.
        budget: pours, all told; those of a surrogate that is found wrong at its fits, and that
            contradict what these say, come on top.
        threads: pours at once; one for each core if None.
        seed: of everything.
        thresholds: of the verdict.
        surrogate: of the same archive, where it has been fitted for another task.
        pairs: simulated pairs that calibrate the interval of a named effect's strength, each as
            many pours as were measured to fit; 19 are the fewest from which 95 % can be read, and
            0 leaves the interval of the model's own pours.
        rounds: of further pours where the fits are, once the residual test has rejected; each
            takes up to `refine.ROUND` pours, and everything is asked again afterwards.
        say: is told each step.
        command: what makes the report again, as its page says; this call if None.

    Raises:
        TypeError: `task` is no Task, or a number is not whole.
        ValueError: a number is negative, or too large.
        ObservationError: recordings that do not fit the scene, a budget that is too small, or too
            few pairs.
        TrainingDataError: an archive of something else.
    """
    check_call(task, budget=budget, threads=threads, seed=seed, pairs=pairs, rounds=rounds)
    # Those of NumPy cannot be registered.
    budget, seed, pairs, rounds = int(budget), int(seed), int(pairs), int(rounds)
    folder, rules = Path(out), thresholds or Thresholds()
    workers = threads or cores()
    plan = planned(task, budget, seed, pairs, rounds, rules)
    names = Measures.of(plan.scene).names
    if archive is not None:
        require_same(Path(archive), plan)
    # Before hours of pours and before anything is fixed; what the recordings say is let go.
    doubts = task.require_readable()
    registration = register(folder, task, plan, rules, seed, names, pairs, rounds)
    say(f"registered before any data: {folder / 'preregistration.json'} {registration[:12]}")

    store = Archive(folder / "archive" if archive is None else Path(archive), plan)
    _tell_before_pours(task, store, budget, workers, doubts, say)
    store.fill(threads=threads, say=say)
    poured = seen_of(store)
    if surrogate is None:
        surrogate = fit_surrogate(store, seed=seed, say=say)
    else:
        surrogate = replace(surrogate, anchor=None)
    analysis = Analysis(task, store.plan, Forward(folder / "pours", workers), rules, seed, say)
    sights = _power_of(analysis, surrogate)
    say(_power_table(sights))

    measured = analysis.measured()
    observed = analysis.observed(measured)
    found = trace(surrogate, observed, rules, seed=seed)
    say(f"the fits say {found.verdict.kind}: {found.verdict.reason}")

    # By the same names: what was known before is let go.
    found, surrogate, best, draws, drawn_of, learnt = learning(
        analysis, surrogate, found, observed, measured, rounds
    )
    looked = look_again(analysis, surrogate, found, observed, measured)
    settled, there = looked.settled, looked.placed
    found, surrogate = settled.trace, settled.surrogate
    hidden = task.of(SEALED)
    if found.best.effects != drawn_of and rules.look:
        # The winner is another: no random draw of it has been poured.
        best, draws = drawn(analysis, surrogate, found, measured), draws + rules.look
    found, of_base, own = there.trace, there.of_base, there.own
    _tell_left(own, of_base, say)
    of_hidden = {c.name: both(analysis.forward, task, c, found, settled.seed) for c in hidden}
    simulated = there.simulated | of_hidden
    elsewhere = moved(analysis, surrogate)
    for other in elsewhere:
        say(f"defined as {other.definition}: {other.verdict.kind}, p = {other.verdict.p:.3g}")
    wide = calibrated(analysis, surrogate, found, pairs)
    if wide is not None:
        say(_coverage_told(wide))
    recorded = as_recorded(analysis, surrogate, found, measured, simulated)
    fit = error_of(task, analysis.fitted, measured, recorded, surrogate, seed)
    # Opened here, once, after everything that could be chosen has been.
    measured |= {c.name: c.statistics(task.read_scene) for c in hidden}
    sealed = error_of(task, hidden, measured, recorded, surrogate, seed) if hidden else None
    standing = stand(
        found.verdict,
        rules,
        confirmed=settled.confirmed,
        anchors=settled.anchors,
        looked=looked.rounds,
        weighed=[one.said for one in looked.weighed],
        own=own,
        of_base=of_base,
        draws=draws,
        nearer=nearer(analysis, surrogate, found, best, measured, simulated),
        error=fit,
        sealed=sealed,
        is_sealed_off=has_unknown_errors(task),
        size=Measures.of(task.scene).head,
        moved=elsewhere,
        trivial=trivial(analysis, surrogate, measured, recorded),
        seen=poured,
    )
    say(f"verdict {standing.verdict.kind}: {standing.verdict.reason}")

    pretended = [(c, placebo_of(analysis.forward, task, c, found, seed)) for c in analysis.fitted]
    blank = [analysis.pours(c, rows) for c, rows in pretended if len(rows)]
    placebo = trace(surrogate, blank, rules, seed=seed + 1)
    say(f"placebo {placebo.verdict.kind}: {placebo.verdict.reason}")
    verdict = standing.verdict
    alarms = of_error(verdict, fit, sealed) + of_placebo(placebo.verdict, rules)
    is_taken_back = bool(found.best.effects) and not verdict.named
    alarms += of_left(verdict, fit, sealed, is_taken_back=is_taken_back)
    alarms += of_rows(standing) + told_unseen(poured)
    alarms += of_ends(verdict, found.best, task) + of_untried(verdict, task.untried)
    alarms += of_base_fit(verdict, settled.at_base, rules)
    alarms += of_prior(verdict, found.base, task)
    if verdict.kind != "NONE":
        alarms += of_alone(surrogate, observed, found, rules)
    # A mean over time is steadier than a pour.
    single = [o for c, o in zip(analysis.fitted, observed, strict=True) if not c.averaged]
    at_fit = found.fit_of(found.best)
    alarms += of_scatter(scatter_of(surrogate, at_fit, single, seed=seed), rules)
    spread = surrogate.raw_spread[: Measures.of(task.scene).head]
    of_base_pours = {name: pours.base for name, pours in simulated.items()}
    everywhere = (*analysis.fitted, *hidden)
    alarms += of_exchange(everywhere, measured, of_base_pours, spread, (fit, sealed))
    for alarm in alarms:
        say(f"warning: {alarm}")
    closed = Closed(
        task=task,
        standing=standing,
        trace=found,
        power=sights,
        fit=fit,
        sealed=sealed,
        placebo=placebo,
        experiments=tuple(next_experiment(surrogate, found, _candidates(analysis.plan))),
        pours=plan.pours
        + _needed(task, pairs if wide is not None else 0, draws)
        + learnt
        + settled.before
        + there.pours
        + looked.pours,
        registration=registration,
        measured=measured,
        simulated=recorded,
        corrections=corrected(analysis, surrogate, found, measured, recorded),
        calibrated=wide,
        doubts=(*doubts, *alarms),
        seen=poured,
    )
    said = {"kind": verdict.kind, "named": list(verdict.named)}
    models_of(task, analysis.plan, surrogate, found, said, measured, simulated).write(folder)
    write_beside(folder / "verdict.json", json.dumps(closed.to_dict(), indent=1) + "\n")
    write_report(
        closed,
        folder,
        command=command
        or f"granulcal.close_loop(task, {str(folder)!r}, budget={budget}, seed={seed}, "
        f"pairs={pairs}, rounds={rounds})",
        title=f"Closing the loop on {task.path or task.scene.name}",
        say=say,
    )
    return closed


@one_thread()
def planned(
    task: Task,
    budget: int,
    seed: int,
    pairs: int = 0,
    rounds: int = 0,
    rules: Thresholds | None = None,
) -> ArchivePlan:
    """Returns the archive that a budget affords.

    Kept back are the pours of `pairs` and `rounds`, and the draws that `rules` look at, if any.

    Raises:
        ObservationError: it affords too little, with what would be enough.
    """
    own = sum(not effect.is_free for effect in task.library)
    draws = 0 if rules is None else ROUNDS * rules.look
    kept = _needed(task, pairs, draws) + rounds * ROUND
    spare = budget - kept
    # A small budget has fewer pours to share than the base model needs.
    base = max(int(_BASE_SHARE * spare), min(_LEAST_BASE, spare - _LEAST_EACH * own))
    each = (spare - base) // max(own, 1)
    if base < _LEAST_BASE or (own and each < _LEAST_EACH):
        enough = kept + max(
            _LEAST_BASE + _LEAST_EACH * own, int(_LEAST_EACH * own / (1 - _BASE_SHARE)) + 1
        )
        raise ObservationError(
            f"a budget of {budget} pours is too small for {len(task.conditions)} conditions and "
            f"{len(task.library)} effects, {own} of them poured; {enough} would be enough"
        )
    return ArchivePlan(
        scene=task.at_first(),
        prior=task.prior,
        conditions=task.inputs,
        library=task.library,
        base=base,
        each=each,
        seed=seed,
        tolerances=task.tolerances,
        places=task.places,
    )


def _needed(task: Task, pairs: int, draws: int) -> int:
    """Pours besides the archive: both models, draws of the prior, placebo and pairs."""
    fitted = task.of(FIT)
    measured = sum(len(c.recordings) for c in fitted)
    # A pour in the limit of the grains' size is several of two sizes.
    each, sizes = (1, 1) if task.coarse is None else (2 * task.coarse.repeats, 2)
    prior = (sizes * draws + each * REPLICATES if draws else 0) * len(fitted)
    return each * (2 * REPLICATES * len(task.conditions) + (1 + pairs) * measured) + prior


def _candidates(plan: ArchivePlan) -> list[tuple[str, Array]]:
    """Conditions that further pours might have: each input over its range, others in the middle.

    Or those of the archive, where it has pours there alone.
    """
    found = []
    for place in plan.places:
        label = ", ".join(f"{p} = {place[p]:.4g}" for p, _, _ in plan.conditions if p in place)
        # Observed as the verdict is.
        observed = {p: plan.scene.get(p) for p, _, _ in plan.conditions if p not in place}
        found.append((label, plan.unit({**observed, **place})))
    if found:
        return found
    for i, (path, low, high) in enumerate(plan.conditions):
        if is_definition(path):
            continue
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            at = np.full(len(plan.conditions), 0.5)
            at[i] = share
            found.append((f"{path} = {low + share * (high - low):.4g}", at))
    return found


def _tell_before_pours(
    task: Task,
    store: Archive,
    budget: int,
    workers: int,
    doubts: tuple[str, ...],
    say: Callable[[str], None],
) -> None:
    """What is known before the first pour: how level the test is, how long it takes, doubts."""
    plan = store.plan
    if plan.base < _LEVEL_BASE or (0 < plan.each < _LEVEL_EACH):
        say(
            f"note: with {plan.base} pours of the base and {plan.each} of each effect the residual "
            "test calls a right model wrong more often than it says, at p = 0.05 up to one in six; "
            f"from {_LEVEL_BASE} and {_LEVEL_EACH} on one in twelve (docs/theory/loop.md)"
        )
    say(time_needed(task, store, budget - plan.pours, workers))
    warn(doubts)
    if store.missing:
        # Whoever goes on has been told.
        for sentence in drifts(task):
            say(sentence)


def _power_of(analysis: Analysis, surrogate: Surrogate) -> Power:
    """What the pours could show in the middle of the prior, at the conditions that are fitted."""
    counts = [len(condition.recordings) for condition in analysis.fitted]
    middle = np.full(len(analysis.task.prior.names), 0.5)
    units = [analysis.plan.unit(c.at) for c in analysis.fitted]
    sessions = session_numbers([c.session for c in analysis.fitted])
    return power(surrogate, middle, units, counts, sessions)


def _tell_left(
    own: Recentred | None, of_base: Recentred | None, say: Callable[[str], None]
) -> None:
    """What pours of the verdict's model and of the base model leave of the measured ones."""
    if own is not None:
        say(f"its pours leave of the measured ones what has p = {own.residual_test.p:.3g}")
    if of_base is not None and own is not of_base:
        say(f"pours of the base model leave what has p = {of_base.residual_test.p:.3g}")


def _coverage_told(wide: Coverage) -> str:
    of_it = "the whole range" if wide.is_whole_range else f"stretched by {wide.stretch:.3g}"
    return f"{wide.held} of {wide.pairs} simulated pairs held by the plain interval; {of_it}"


def _power_table(sights: Power) -> str:
    lines = ["what these pours could show (kappa: share that the parameters cannot mimic):"]
    lines.append(f"  {'effect':<24}{'kappa':>8}{'smallest strength seen in 80 %':>34}")
    for name, kappa, least in zip(sights.effects, sights.kappa, sights.shown, strict=True):
        shown = "-" if np.isnan(kappa) else f"{kappa:.2f}"
        size = f"{least:.2f}" if least <= 1 else "-" if np.isnan(least) else "none of its range"
        lines.append(f"  {name:<24}{shown:>8}{size:>34}")
    return "\n".join(lines)
