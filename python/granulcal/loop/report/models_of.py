"""The models of a closed loop, as `models.json` keeps them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.engines.in_use import engine_in_use
from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.pours.archive import ArchivePlan
from granulcal.loop.pours.cube import from_cube
from granulcal.loop.pours.replicates import ModelPours
from granulcal.loop.report.models import Maker, Models
from granulcal.loop.surrogate.fit_draws import draw
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import FIT, Task
from granulcal.loop.test.trace import Explanation, Trace

__all__ = ["models_of", "scatter_of"]

Array = NDArray[np.float64]

# Draws of a fit that are kept, and the seed of them.
_DRAWS, _SEED = 40, 8_500_003


def models_of(
    task: Task,
    plan: ArchivePlan,
    surrogate: Surrogate,
    found: Trace,
    verdict: dict[str, object],
    measured: dict[str, Array],
    simulated: dict[str, ModelPours],
) -> Models:
    """Returns what predicts under further conditions.

    Args:
        task: scene, prior, conditions.
        plan: of the archive.
        surrogate: of the trace.
        found: the trace.
        verdict: the final word and the names.
        measured: pours of every condition, by name.
        simulated: of the base and of the verdict's model, by condition's name.
    """
    fitted = task.of(FIT)
    # One pour borrows the scatter of simulated ones.
    rows = [one if len(one := measured[c.name]) > 1 else simulated[c.name].base for c in fitted]
    return Models(
        scene=task.at_first(),
        verdict=verdict,
        paths=task.paths,
        inputs=plan.conditions,
        names=surrogate.labels,
        makers={
            "base": _makers(task, plan, found, found.base),
            "named": _makers(task, plan, found, found.best),
        },
        columns=tuple(int(j) for j in surrogate.columns),
        transforms=surrogate.transforms,
        correction=Discrepancy.of(found.local, found.base_fit),
        known=np.array([plan.unit(c.at) for c in fitted]).reshape(len(fitted), -1),
        means=np.array([measured[c.name].mean(axis=0) for c in fitted]),
        scatter=scatter_of(rows, surrogate.raw_spread),
        pours=np.array([float(len(measured[c.name])) for c in fitted]),
        coarse=task.coarse,
        engine=None if (engine := engine_in_use()) is None else engine.name,
        shared=_shared(task),
        strengths=dict(zip(found.best.effects, found.best.best_strengths.tolist(), strict=True)),
    )


def _shared(task: Task) -> dict[str, float]:
    """Numbers that every condition states, and each the same."""
    first, *others = (condition.at for condition in task.conditions)
    return {p: v for p, v in first.items() if all(at[p] == v for at in others)}


def scatter_of(rows: Sequence[Array], spread: Array) -> Array:
    """Returns the standard deviation of one pour under each condition, shape (H, s).

    Where fewer than two pours tell it, it is the mean of the others, else that of the archive.

    Args:
        rows: pours of each condition, shape (n, s) each.
        spread: of the archive, infinite where nothing varies, shape (s,).
    """
    variances = [one.var(axis=0, ddof=1) for one in rows if len(one) > 1]
    wide = np.where(np.isfinite(spread), spread, 0.0)
    borrowed = np.sqrt(np.mean(variances, axis=0)) if variances else wide
    return np.array([one.std(axis=0, ddof=1) if len(one) > 1 else borrowed for one in rows])


def _makers(task: Task, plan: ArchivePlan, found: Trace, one: Explanation) -> tuple[Maker, ...]:
    """The numbers of a model at its fit, then those of draws of it."""
    drawn = draw(found.fit_of(one), plan.design, _DRAWS, seed=_SEED)
    thetas = np.concatenate([one.theta[None], drawn[0]])
    strengths = np.concatenate([one.best_strengths[None], drawn[1]])
    return tuple(
        _maker(task, theta, dict(zip(one.effects, psi.tolist(), strict=True)))
        for theta, psi in zip(thetas, strengths, strict=True)
    )


def _maker(task: Task, theta: Array, strengths: dict[str, float]) -> Maker:
    own = from_cube(task.prior, theta[None])[0].tolist()
    numbers = {**task.prior.fixed, **dict(zip(task.prior.names, own, strict=True))}
    shifts: dict[str, float] = {}
    faults: dict[str, float] = {}
    for name, psi in strengths.items():
        effect = task.effect(name)
        numbers |= effect.numbers(psi)
        faults |= effect.faults(psi)
        if effect.shift:
            shifts[effect.path] = effect.full * psi
    return Maker(numbers, shifts, faults)
