r"""The whole prior before a verdict is said: true pours of random draws of the winner.

A fit moves downhill on a surrogate from where the surrogate says; where that is wrong by more than
it knows, the best place is never visited. So the verdict's model is poured under every condition to
fit at a Latin hypercube of its parameters and strengths, one pour each, and

$$ E^2_b = \frac1H \sum_h \lVert \bar y_h - x_{bh} \rVert^2 $$

tells how far each is from the data, the noise of one pour included. The pours join the archive's
rows, everything is asked again, and the fits start from the best of them as well. The best draw is
poured once more, as often as the fit is: a fit that is farther from the data than a random draw is
no optimum, and no verdict rests on it.

Reference:
    McKay, Beckman and Conover, A comparison of three methods for selecting values of input
    variables, Technometrics 21, 1979.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.analysis import Analysis
from granulcal.loop.effects.design import Design, normal_from_cube
from granulcal.loop.pours.replicates import seed_under
from granulcal.loop.pours.rows import Rows
from granulcal.loop.pours.scenes import faults_of, scene_of
from granulcal.loop.surrogate.baseline import Start
from granulcal.loop.test.trace import Trace

__all__ = ["PriorPours", "hypercube", "prior_pours"]

Array = NDArray[np.float64]

# Fits begin from so many of the best draws.
_STARTS = 3
# Seeds of these pours, apart from those of the archive, of replicates, of refinement; of a round.
_SEED, _ROUND_STEP = 9_700_009, 5000


@dataclass(frozen=True)
class PriorPours:
    """Pours of random draws of a model.

    Attributes:
        effects: of the model.
        rows: the pours, for the archive; None where none was usable.
        theta: of the draws that could be poured under every condition, shape (n, p).
        strengths: of the model's effects at these, shape (n, |A|).
        squares: E^2 of each, mean over the conditions, shape (n,), smallest first.
    """

    effects: tuple[str, ...]
    rows: Rows | None
    theta: Array
    strengths: Array
    squares: Array

    def starts(self, design: Design) -> tuple[Start, ...]:
        """Returns where fits begin as well."""
        found, names = [], [effect.name for effect in design.effects]
        for theta, strengths in zip(self.theta[:_STARTS], self.strengths[:_STARTS], strict=True):
            psi = design.none()
            for name, value in zip(self.effects, strengths, strict=True):
                psi[names.index(name)] = value
            found.append(Start(normal_from_cube(theta), psi))
        return tuple(found)


def hypercube(count: int, dimensions: int, seed: int) -> Array:
    """Returns a Latin hypercube in (0, 1), shape (count, dimensions)."""
    generator = np.random.default_rng(seed)
    cells = np.stack([generator.permutation(count) for _ in range(dimensions)], axis=1)
    return (cells + generator.random((count, dimensions))) / count


def prior_pours(
    analysis: Analysis, found: Trace, measured: dict[str, Array], spread: Array, number: int
) -> PriorPours:
    """Returns pours of as many random draws of the verdict's model as the rules ask.

    Args:
        analysis: what was fixed, and what runs the pours.
        found: the trace whose winner is drawn.
        measured: statistics of the pours of every condition to fit, by name.
        spread: standard deviation of the head's statistics over the archive, shape (s,).
        number: of this round, from 0.
    """
    task, plan, count = analysis.task, analysis.plan, analysis.rules.look
    names, known = found.best.effects, [effect.name for effect in plan.design.effects]
    indices = [known.index(name) for name in names]
    effects = [plan.design.effects[k] for k in indices]
    p, conditions = len(plan.prior.names), analysis.fitted
    first = _SEED + analysis.seed + _ROUND_STEP * number
    drawn = hypercube(count, p + len(effects), first)
    low = np.array([effect.low for effect in effects])
    theta, strengths = drawn[:, :p], low + drawn[:, p:] * (1 - low)
    kept: list[Rows] = []
    poured: list[tuple[int, list[Array]]] = []
    coarse = task.coarse
    held = np.array([effect.held is not None for effect in plan.design.effects], dtype=bool)
    for i in range(count):
        own = dict(zip(names, strengths[i].tolist(), strict=True))
        rows = []
        for condition in conditions:
            scene, faults = scene_of(task, condition, theta[i], own), faults_of(task, own)
            sizes = {0.0: scene} | ({1.0: scene.with_(coarse.numbers)} if coarse else {})
            seen = []
            for size, sized in sizes.items():
                x = analysis.forward.pours(sized, [seed_under(condition, first + i)], faults)
                if len(x) == 0:
                    continue
                psi = np.where(held, size, 0.0)
                psi[indices] = strengths[i]
                where = plan.unit(condition.at)
                kept.append(Rows(theta[i : i + 1], where[None], psi[None], x[:1]))
                seen.append(x[0])
            if len(seen) == len(sizes):
                fine, other = seen[0], seen[-1]
                rows.append(fine + (coarse.held if coarse else 0.0) * (other - fine))
        if len(rows) == len(conditions):
            poured.append((i, rows))
    whole = Rows.joined(kept) if kept else None
    if not poured:
        none = np.empty(0)
        return PriorPours(names, whole, theta[:0], strengths[:0], none)
    size = len(spread)
    squares = np.zeros(len(poured))
    for b, (_, rows) in enumerate(poured):
        for x, condition in zip(rows, conditions, strict=True):
            gap = (measured[condition.name][:, :size].mean(axis=0) - x[:size]) / spread
            squares[b] += float(gap @ gap) / len(conditions)
    order = np.argsort(squares)
    chosen = [poured[int(b)][0] for b in order]
    return PriorPours(names, whole, theta[chosen], strengths[chosen], squares[order])
