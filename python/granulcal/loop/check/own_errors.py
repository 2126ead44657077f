r"""What a session's own errors do under its conditions, as those that were fitted tell.

A clock or a camera's tilt that every condition has of its own is one number in all of a session's
(`session` of a condition). With r what pours of a model leave of the measured ones under the
conditions to fit, S its covariance (`recentre.py`) and $C_{cf}$ the covariance of the declared
nuisances between a condition c and the fitted ones,

$$ E[e_c \mid r] = C_{cf} S^{-1} r $$

is by how much the statistics of c are off in the mean. A model's pours are moved by that before
they are held against the measurement: how wrongly a clock was set is no error of the model, where
another recording of the day has told it. Conditions of other sessions stay as they are.

Simulated pairs (`coverage.py`) have errors drawn of the same covariance: pours alone have none, and
a fit that allows for them would seem to hold the truth more often than it does of measured ones.

Reference:
    Rasmussen and Williams, Gaussian processes for machine learning, 2006, equation 2.23.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.check.recentre import gap_of
from granulcal.loop.pours.replicates import FEWEST, ModelPours
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.condition_pours import ConditionPours, session_numbers
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.loop.test.trace import Trace

__all__ = ["as_recorded", "has_unknown_errors", "in_told_sessions", "with_own_errors"]

Array = NDArray[np.float64]


def in_told_sessions(task: Task) -> list[Condition]:
    """Returns the conditions of sessions of which one is fitted."""
    sessions = {c.session for c in task.of(FIT)} - {""}
    return [c for c in task.conditions if c.session in sessions]


def has_unknown_errors(task: Task) -> bool:
    """Returns whether sealed recordings may be off by declared errors that no fitted one tells."""
    is_declared = task.tolerances is not None or any(
        effect.nuisance_sd is not None for effect in task.library
    )
    told = [c.name for c in in_told_sessions(task)]
    return is_declared and any(c.name not in told for c in task.of(SEALED))


def as_recorded(
    analysis: Analysis,
    surrogate: Surrogate,
    found: Trace,
    measured: Mapping[str, Array],
    simulated: dict[str, ModelPours],
) -> dict[str, ModelPours]:
    """Returns pours of both models with the own errors of the sessions that were fitted.

    Args:
        analysis: task and pours.
        surrogate: whose slopes and noise are used.
        found: the trace, whose fits the pours are at.
        measured: statistics under each condition to fit, by name.
        simulated: pours of both models under every condition, by name.
    """
    told = in_told_sessions(analysis.task)
    if not told or min(len(rows) for c in analysis.fitted for rows in simulated[c.name]) < FEWEST:
        return simulated
    models = [found.base] if found.best is found.base else [found.base, found.best]
    moved = []
    for number, one in enumerate(models):
        rows = {name: pours[number] for name, pours in simulated.items()}
        moved.append(_moved(analysis, surrogate, found.fit_of(one), measured, rows, told))
    base, augmented = moved[0], moved[-1]
    return {name: ModelPours(base[name], augmented[name]) for name in simulated}


def with_own_errors(
    surrogate: Surrogate, v: Array, pours: Sequence[ConditionPours], generator: np.random.Generator
) -> list[ConditionPours]:
    """Returns pours of several conditions, moved as one draw of the declared nuisances does.

    Args:
        surrogate: whose nuisances these are.
        v: z-scores of the parameters that the pours have, shape (p,).
        pours: without such errors.
        generator: of the draw; nothing is drawn without nuisances.
    """
    design = surrogate.design
    if not design.nuisances:
        return list(pours)
    stack = StackedMeans.of(surrogate, pours)
    local = LinearisedSurrogate.at(surrogate, stack.conditions, stack.counts, v, stack.sessions)
    by = np.zeros_like(stack.means)
    for k, along in zip(design.nuisances, local.own_errors, strict=True):
        # A session has the number of its first condition.
        drawn = generator.standard_normal(len(pours))
        of = np.zeros_like(stack.sessions) if design.effects[k].is_shared else stack.sessions
        by += drawn[of, None] * along
    return [
        replace(one, pours=surrogate.moved(one.pours, y)) for one, y in zip(pours, by, strict=True)
    ]


def _moved(
    analysis: Analysis,
    surrogate: Surrogate,
    fit: Fit,
    measured: Mapping[str, Array],
    simulated: dict[str, Array],
    told: Sequence[Condition],
) -> dict[str, Array]:
    """One model's pours, moved under the conditions that are `told`."""
    seen, poured = analysis.observed(measured), analysis.observed(simulated)
    _, root, gap = gap_of(surrogate, fit, seen, poured)
    weights = np.linalg.solve(root.T, np.linalg.solve(root, gap))
    everywhere = [*analysis.fitted, *told]
    local = LinearisedSurrogate.at(
        surrogate,
        np.array([analysis.plan.unit(c.at) for c in everywhere]).reshape(len(everywhere), -1),
        np.ones(len(everywhere)),
        fit.v,
        session_numbers([c.session for c in everywhere]),
    )
    shifts = (local.nuisance[len(gap) :, : len(gap)] @ weights).reshape(len(told), -1)
    moved = {
        c.name: surrogate.moved(simulated[c.name], y) for c, y in zip(told, shifts, strict=True)
    }
    return simulated | moved
