"""`close_loop`: from recordings to a verdict, with the error before and after.

The steps are those of docs/theory/loop.md: register what is fixed; fill the archive; say what could
be seen; fit and test; refit the library; decide; simulate the base and the augmented model; open
the sealed conditions once; run the placebo; write the report.
"""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.files import write_beside
from granulcal.loop.archive import Archive, Plan
from granulcal.loop.checks import calibrated, confirmed, corrected
from granulcal.loop.correction import Correction
from granulcal.loop.cube import from_cube
from granulcal.loop.experiment import Experiment, next_experiment
from granulcal.loop.forward import Forward
from granulcal.loop.measures import Measures
from granulcal.loop.misfit import Improvement, compare
from granulcal.loop.observation import Observation
from granulcal.loop.pairs import FEWEST_PAIRS, Calibrated
from granulcal.loop.preregistration import register
from granulcal.loop.refine import ROUND, Rows, further
from granulcal.loop.scenes import faults_of, scene_of
from granulcal.loop.surrogate import Surrogate
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.loop.thresholds import Thresholds
from granulcal.loop.trace import Explanation, Power, Trace, power, trace
from granulcal.one_thread import one_thread
from granulcal.scene import Scene

__all__ = ["Closed", "close_loop", "fit_surrogate", "planned"]

Array = NDArray[np.float64]

# Simulated pours of each model under each condition.
_REPLICATES = 10
# Fewest of them that say something of an error.
_FEWEST = 2
# Fewest pours of the base and of each effect from which a surrogate is any use.
_LEAST_BASE, _LEAST_EACH = 300, 40
# Shares of a budget: the base model has more directions than any one effect.
_BASE_SHARE = 0.4
# Seeds of replicates, apart from those of the archive.
_SEED = 7_000_003


@dataclass(frozen=True)
class Closed:
    """What the loop found.

    Attributes:
        task: what was asked.
        trace: fit, gate, refits and verdict on the conditions to fit.
        power: what could be seen, before the data.
        fit: error before and after, conditions to fit.
        sealed: the same of the sealed conditions; None without any.
        placebo: the same pipeline on pours of the base model at its fit.
        experiments: which further pours would tell most.
        pours: that this analysis needed: archive, replicates, placebo.
        registration: SHA-256 of what was fixed beforehand.
        measured: statistics of every condition's pours, by name.
        simulated: of the base and of the augmented model, by condition's name.
        corrections: what the correction without physics leaves; none where nothing was detected.
        confirmed: p that the surrogate is right at the verdict's model, by fresh pours of it.
        calibrated: the interval of the named effect's strength by simulated pairs; None without.
    """

    task: Task
    trace: Trace
    power: Power
    fit: Improvement
    sealed: Improvement | None
    placebo: Trace
    experiments: tuple[Experiment, ...]
    pours: int
    registration: str
    measured: dict[str, Array]
    simulated: dict[str, tuple[Array, Array]]
    corrections: tuple[Correction, ...] = ()
    confirmed: float = float("nan")
    calibrated: Calibrated | None = None

    def scene(self, condition: Condition, one: Explanation) -> Scene:
        """Returns the scene of a model at its best fit under a condition."""
        return _scene(self.task, condition, one)

    def faults(self, one: Explanation) -> dict[str, float]:
        """Returns the faults of the image of a model at its best fit, by kind."""
        return _faults(self.task, one)

    def parameters(self) -> dict[str, dict[str, float]]:
        """Returns the parameters before and after, in their own units.

        How far the missing effect had bent them.
        """
        prior = self.task.prior
        before = from_cube(prior, self.trace.base.theta[None])[0]
        after = from_cube(prior, self.trace.best.theta[None])[0]
        return {
            name: {"before": float(b), "after": float(a)}
            for name, b, a in zip(prior.names, before, after, strict=True)
        }

    def strengths(self) -> dict[str, tuple[float, float, float]]:
        """Low, middle and high of each named effect's number, in the scene's unit.

        Of the effect that simulated pairs were poured for the interval is theirs.
        """
        found: dict[str, tuple[float, float, float]] = {}
        for one in self.trace.explanations:
            for name, middle, (low, high) in zip(
                one.effects, one.strengths, one.intervals, strict=True
            ):
                if one is self.trace.best and self.calibrated is not None:
                    low, high = self.calibrated.interval
                if name in self.trace.verdict.named and name not in found:
                    effect = self.task.effect(name)
                    if not effect.camera:
                        ends = sorted((effect.value(low), effect.value(high)))
                        found[name] = (ends[0], effect.value(middle), ends[1])
        return found

    def to_dict(self) -> dict[str, Any]:
        """Returns everything for JSON."""
        verdict = self.trace.verdict

        def squares(improvement: Improvement | None) -> dict[str, float] | None:
            if improvement is None:
                return None
            before, after = improvement.total_before, improvement.total_after
            return {"before": before.square, "after": after.square}

        return {
            "verdict": verdict.kind,
            "named": list(verdict.named),
            "families": list(verdict.families),
            "p": verdict.p,
            "reason": verdict.reason,
            "strength": self.strengths(),
            "misfit": {"fit": squares(self.fit), "sealed": squares(self.sealed)},
            "confirmed_p": None if np.isnan(self.confirmed) else self.confirmed,
            "calibrated": None if self.calibrated is None else self.calibrated.to_dict(),
            "correction": [one.to_dict() for one in self.corrections],
            "pours": self.pours,
            "placebo": {"verdict": self.placebo.verdict.kind, "p": self.placebo.verdict.p},
            "registration_sha256": self.registration,
            "fit": self.fit.to_dict(),
            "sealed": None if self.sealed is None else self.sealed.to_dict(),
            "parameters": self.parameters(),
            "next_experiments": [one.to_dict() for one in self.experiments],
            "power_before_data": self.power.to_dict(),
            "trace": self.trace.to_dict(),
        }


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
    pairs: int = 0,
    rounds: int = 0,
    say: Callable[[str], None] = print,
) -> Closed:
    """Finds what a model lacks, adds it, and tells the error before and after.

    Args:
        task: scene, prior, recordings.
        out: folder of the report; one that was cut off goes on.
        archive: folder of the pours, shared between analyses of one scene; `out`/archive if None.
        budget: pours, all told.
        threads: pours at once; one for each core if None.
        seed: of everything.
        thresholds: of the verdict.
        surrogate: of the same archive, where it has been fitted for another task.
        pairs: simulated pairs that calibrate the interval of a named effect's strength, each as
            many pours as were measured to fit; 19 are the fewest from which 95 % can be read.
        rounds: of further pours where the fits are, once the gate has opened; each takes up to
            `refine.ROUND` pours, and everything is asked again afterwards.
        say: is told each step.

    Raises:
        ObservationError: recordings that do not fit the scene, a budget that is too small, or too
            few pairs.
        TrainingDataError: an archive of something else.
    """
    if pairs and pairs < FEWEST_PAIRS:
        raise ObservationError(
            f"pairs must be 0, or at least {FEWEST_PAIRS} to read 95 % from, got {pairs}"
        )
    folder, rules = Path(out), thresholds or Thresholds()
    workers = threads or os.cpu_count() or 1
    plan = planned(task, budget, seed, pairs, rounds)
    names = Measures.of(plan.scene).names
    registration = register(folder, task, plan, rules, seed, names, pairs, rounds)
    say(f"registered before any data: {folder / 'preregistration.json'} {registration[:12]}")

    store = Archive(folder / "archive" if archive is None else Path(archive), plan)
    store.fill(threads=threads, say=say)
    surrogate = surrogate or fit_surrogate(store, seed=seed, say=say)
    fitted = task.of(FIT)
    counts = [len(condition.recordings) for condition in fitted]
    middle = np.full(len(task.prior.names), 0.5)
    sights = power(surrogate, middle, [store.plan.unit(c.at) for c in fitted], counts)
    say(_power_table(sights))

    measured = {c.name: c.statistics(task.scene) for c in fitted}
    observed = [Observation.of(c.name, store.plan.unit(c.at), measured[c.name]) for c in fitted]
    found = trace(surrogate, observed, rules, seed=seed)
    say(f"verdict {found.verdict.kind}: {found.verdict.reason}")

    forward, more = Forward(folder / "pours", workers), list[Rows]()
    for number in range(rounds):
        if found.gate.p > rules.name:
            break
        more.extend(further(forward, task, store.plan, found, number, seed))
        surrogate = fit_surrogate(store, seed=seed, say=say, more=more)
        found = trace(surrogate, observed, rules, seed=seed)
        say(f"after pours where the fits are, {found.verdict.kind}: {found.verdict.reason}")
    simulated = {c.name: _both(forward, task, c, found, seed) for c in task.conditions}
    right = confirmed(surrogate, store.plan, fitted, found, simulated)
    say(f"fresh pours of the verdict's model: the surrogate is right there with p = {right:.3g}")
    wide = calibrated(forward, task, store.plan, surrogate, found, rules, pairs, seed)
    if wide is not None:
        held = f"{wide.held} of {wide.pairs} simulated pairs held by the plain interval"
        say(f"{held}; stretched by {wide.stretch:.3g}")
    fit = _compare(task, fitted, measured, simulated, surrogate, seed)
    hidden = task.of(SEALED)
    # Opened here, once, after everything that could be chosen has been.
    measured |= {c.name: c.statistics(task.scene) for c in hidden}
    sealed = _compare(task, hidden, measured, simulated, surrogate, seed) if hidden else None

    pretended = [(c, _placebo(forward, task, c, found, seed)) for c in fitted]
    blank = [
        Observation.of(c.name, store.plan.unit(c.at), rows) for c, rows in pretended if len(rows)
    ]
    placebo = trace(surrogate, blank, rules, seed=seed + 1)
    say(f"placebo {placebo.verdict.kind}: {placebo.verdict.reason}")
    experiments = next_experiment(surrogate, found, _candidates(store.plan))
    closed = Closed(
        task=task,
        trace=found,
        power=sights,
        fit=fit,
        sealed=sealed,
        placebo=placebo,
        experiments=tuple(experiments),
        pours=plan.pours
        + _needed(task, pairs if wide is not None else 0)
        + sum(len(rows.x) for rows in more),
        registration=registration,
        measured=measured,
        simulated=simulated,
        corrections=corrected(task, store.plan, surrogate, found, measured, simulated),
        confirmed=right,
        calibrated=wide,
    )
    write_beside(folder / "verdict.json", json.dumps(closed.to_dict(), indent=1) + "\n")
    return closed


@one_thread()
def fit_surrogate(
    store: Archive,
    *,
    seed: int,
    say: Callable[[str], None] = print,
    more: Sequence[Rows] = (),
) -> Surrogate:
    """Returns the surrogate of all pours of an archive, and of `more`."""
    rows, design = store.pours(), store.plan.design
    whole = [rows, *more]
    theta = np.concatenate([part.theta for part in whole])
    condition = np.concatenate([part.condition for part in whole])
    psi = np.concatenate([part.psi for part in whole])
    x = np.concatenate([part.x for part in whole])
    say(f"surrogate of {len(x)} pours ({rows.left_out} left out: jammed, unhealthy, unseen)")
    return Surrogate.fit(design, theta, condition, psi, x, names=rows.names, seed=seed)


@one_thread()
def planned(task: Task, budget: int, seed: int, pairs: int = 0, rounds: int = 0) -> Plan:
    """Returns the archive that a budget affords, `pairs` and `rounds` of pours kept back.

    Raises:
        ObservationError: it affords too little, with what would be enough.
    """
    own = sum(not effect.is_free for effect in task.library)
    kept = _needed(task, pairs) + rounds * ROUND
    spare = budget - kept
    # A small budget has fewer pours to share than the base model needs.
    base = max(int(_BASE_SHARE * spare), min(_LEAST_BASE, spare - _LEAST_EACH * own))
    each = (spare - base) // max(own, 1)
    if base < _LEAST_BASE or each < _LEAST_EACH:
        enough = kept + max(
            _LEAST_BASE + _LEAST_EACH * own, int(_LEAST_EACH * own / (1 - _BASE_SHARE)) + 1
        )
        raise ObservationError(
            f"a budget of {budget} pours is too small for {own} effects and "
            f"{len(task.conditions)} conditions; {enough} would be enough"
        )
    return Plan(
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


def _needed(task: Task, pairs: int) -> int:
    """Pours besides the archive: both models under every condition, the placebo, and pairs."""
    measured = sum(len(c.recordings) for c in task.of(FIT))
    return 2 * _REPLICATES * len(task.conditions) + (1 + pairs) * measured


def _scene(task: Task, condition: Condition, one: Explanation) -> Scene:
    """The scene of a model at its best fit under a condition."""
    strengths = dict(zip(one.effects, one.best_strengths.tolist(), strict=True))
    return scene_of(task, condition, one.theta, strengths)


def _faults(task: Task, one: Explanation) -> dict[str, float]:
    return faults_of(task, dict(zip(one.effects, one.best_strengths.tolist(), strict=True)))


def _both(
    forward: Forward, task: Task, condition: Condition, found: Trace, seed: int
) -> tuple[Array, Array]:
    """Pours of the base and of the augmented model."""
    seeds = [_SEED + seed + i for i in range(_REPLICATES)]
    before = forward.pours(_scene(task, condition, found.base), seeds)
    if found.best is found.base:
        return before, before
    after = _scene(task, condition, found.best)
    return before, forward.pours(after, seeds, _faults(task, found.best))


def _placebo(forward: Forward, task: Task, condition: Condition, found: Trace, seed: int) -> Array:
    seeds = [_SEED + seed + _REPLICATES + i for i in range(len(condition.recordings))]
    return forward.pours(_scene(task, condition, found.base), seeds)


def _compare(
    task: Task,
    conditions: tuple[Condition, ...],
    measured: dict[str, Array],
    simulated: dict[str, tuple[Array, Array]],
    surrogate: Surrogate,
    seed: int,
) -> Improvement:
    """The paper's 16 statistics, or all that the scene observes, over the archive's spread.

    Conditions under which a model's pours jam or leave the view have no error to tell: left out.

    Raises:
        ObservationError: no condition is left.
    """
    size = Measures.of(task.scene).head
    spread = surrogate.raw_spread[:size]
    told = [c for c in conditions if min(len(rows) for rows in simulated[c.name]) >= _FEWEST]
    if not told:
        raise ObservationError(
            f"fewer than {_FEWEST} of {_REPLICATES} pours at the fit are usable under every one of "
            f"{', '.join(c.name for c in conditions)}: grains jam, leave the view or are unhealthy"
        )
    return compare(
        [c.name for c in told],
        [measured[c.name][:, :size] for c in told],
        [simulated[c.name][0][:, :size] for c in told],
        [simulated[c.name][1][:, :size] for c in told],
        spread,
        seed=seed,
    )


def _candidates(plan: Plan) -> list[tuple[str, Array]]:
    """Conditions that further pours might have: each input over its range, others in the middle.

    Or those of the archive, where it has pours there alone.
    """
    found = []
    for place in plan.places:
        label = ", ".join(f"{path} = {place[path]:.4g}" for path, _, _ in plan.conditions)
        found.append((label, plan.unit(place)))
    if found:
        return found
    for i, (path, low, high) in enumerate(plan.conditions):
        for share in (0.0, 0.25, 0.5, 0.75, 1.0):
            at = np.full(len(plan.conditions), 0.5)
            at[i] = share
            found.append((f"{path} = {low + share * (high - low):.4g}", at))
    return found


def _power_table(sights: Power) -> str:
    lines = ["what these pours could show (kappa: share that the parameters cannot mimic):"]
    lines.append(f"  {'effect':<24}{'kappa':>8}{'smallest strength seen in 80 %':>34}")
    for name, kappa, least in zip(sights.effects, sights.kappa, sights.detectable, strict=True):
        shown = "-" if np.isnan(kappa) else f"{kappa:.2f}"
        size = f"{least:.2f}" if least <= 1 else "none of its range"
        lines.append(f"  {name:<24}{shown:>8}{size:>34}")
    return "\n".join(lines)
