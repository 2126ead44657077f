r"""Which models are within reach of a name: their evidence has an error of its own.

An effect of the image is read from images that are poured anyway, and what it does is well known;
what a poured effect does is known from its share of the archive, and the surrogate's error U of it
spreads its evidence thin, or keeps its fit where nothing of it is unknown, at a strength of 0. So
an effect that is cheap to know may pass for one that is true. With V the covariance of a model at a
strength and $V_0$ that without effects,

$$ \max_\psi \; \log N(r; 0, V) N(\hat v; 0, I) + \frac12 \log \frac{|V|}{|V_0|}
   + \frac{d}{2} \log 2 \pi - \frac12 \log |J^T V^{-1} J + \Lambda| - \log |\mathrm{box}| $$

is the evidence of a model at the mean that suits it best within U, paid for by how far that is from
the surrogate's, as if it were known as the base model is. A model that is by this no less probable
than a name, but for the nats that tell rivals apart, is within reach of it. Nothing but its own
pours says whether it gets there (`rival_rounds.py`, `weigh.py`).

Reference:
    Tierney and Kadane, Accurate approximations for posterior moments, JASA 81, 1986.
    Auer, Cesa-Bianchi and Fischer, Finite-time analysis of the multiarmed bandit problem, Machine
    Learning 47, 2002: what is unsure is tried as if it were as good as it may be.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.surrogate.baseline import Fit, improve
from granulcal.loop.test.refit import Model, root_at
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Explanation, Trace
from granulcal.loop.test.verdict import Verdict, families_of

__all__ = ["Rival", "as_named", "families_in", "within_reach"]

Array = NDArray[np.float64]

# Rivals of a name that are poured, those that reach farthest first.
_MOST = 3
# Strengths at which a single effect is tried, to each side.
_NODES = 6


class Rival(NamedTuple):
    """A model that pours could make as probable as a name.

    Attributes:
        one: the model as it was fitted.
        fit: where it may be as probable.
        reach: its log probability there, over that of no effect, if U were known [nat].
    """

    one: Explanation
    fit: Fit
    reach: float


def within_reach(found: Trace, rules: Thresholds) -> list[Rival]:
    """Returns the rivals of the name that pours could make as probable, at most `_MOST`.

    None of its declared family is a rival, nor is what has a further effect beside it: a second
    effect is asked of what the first one's pours leave.
    """
    best = found.best
    if best is found.base:
        return []
    kin, floor = _declared(found, best.effects), best.log_probability - rules.rivals
    rivals = []
    for one, model in zip(found.explanations, found.models, strict=True):
        if len(one.effects) > len(best.effects) or _declared(found, one.effects) == kin:
            continue
        fit, gain = _farthest(found, model)
        rival = Rival(one, fit, one.log_probability + gain)
        if rival.reach > floor and as_named(found, rival).best.effects == one.effects:
            rivals.append(rival)
    return sorted(rivals, key=lambda rival: -rival.reach)[:_MOST]


def as_named(found: Trace, rival: Rival) -> Trace:
    """Returns the trace as if a rival were named, where it may be as probable."""
    one, fit = rival.one, rival.fit
    moved = replace(
        one, theta=cube_from_normal(fit.v), best_strengths=fit.psi[list(fit.active)].copy()
    )
    models = tuple(
        replace(model, fit=fit) if other is one else model
        for other, model in zip(found.explanations, found.models, strict=True)
    )
    kin = families_in(found, one.effects)
    kind = "EFFECT" if len(kin) == 1 else "EFFECTS"
    return replace(
        found,
        verdict=Verdict(kind, one.effects, kin, found.verdict.p, ""),
        explanations=tuple(moved if other is one else other for other in found.explanations),
        models=models,
    )


def families_in(found: Trace, names: Sequence[str]) -> tuple[str, ...]:
    """Returns the families of effects, parallel ones with the first of their group."""
    design = found.local.surrogate.design
    known = [effect.name for effect in design.effects]
    merged = [tuple(known.index(name) for name in group) for group in found.families]
    return families_of(design, tuple(known.index(name) for name in names), merged)


def _declared(found: Trace, names: Sequence[str]) -> set[str]:
    """Families as the library has them: what is parallel near the base fit need not stay so."""
    effects = {effect.name: k for k, effect in enumerate(found.local.surrogate.design.effects)}
    return {found.local.surrogate.design.family(effects[name]) for name in names}


def _farthest(found: Trace, model: Model) -> tuple[Fit, float]:
    """Where a model may be most probable, and by how much more than at its fit [nat]."""
    local, base, active = found.local, found.base_fit, model.effects
    target = base.residual + local.mean(base.v, base.psi)
    places = [model.fit.psi]
    if len(active) == 1:
        low = local.surrogate.design.effects[active[0]].low
        strengths = np.arange(1, _NODES + 1) / _NODES
        for strength in [*strengths, *(-strengths if low < 0 else ())]:
            places.append(local.none())
            places[-1][active[0]] = strength
    half = float(np.log(np.diag(base.root)).sum())
    tried: list[tuple[float, Fit]] = []
    for psi in places:
        root = root_at(local, base, psi)
        # From the strengths' own fit and from that without any.
        for start in (model.fit.v, base.v):
            fit = improve(local, target, start, psi, (), root=root, steps=6)
            white = np.linalg.solve(root, local.slopes(fit.v, psi, active)[1])
            normal = white.T @ white
            normal[np.diag_indices(len(fit.v))] += 1.0
            known = float(np.log(np.diag(root)).sum()) - half
            reach = fit.log_density + known - 0.5 * float(np.linalg.slogdet(normal)[1])
            tried.append((reach, replace(fit, active=active)))
    # The box and the constants are the same at all strengths: the first two are of the fit.
    at_fit = max(reach for reach, _ in tried[:2])
    root = root_at(local, base, model.fit.psi)
    known = float(np.log(np.diag(root)).sum()) - half
    reach, fit = max(tried, key=lambda pair: pair[0])
    slopes = local.slopes(fit.v, fit.psi, active)[1]
    return replace(fit, slopes=slopes), known + reach - at_fit
