r"""Which further pours would tell rivals apart, or parameters.

With the fit conditions and n further pours under condition c together,

$$ g_{kl}(c) = \tfrac12 (D_k \psi_k - D_l \psi_l)^T M (D_k \psi_k - D_l \psi_l) - g_{kl}(\emptyset),
   \qquad g_\theta(c) = \tfrac12 \log \frac{|J^T V^{-1} J + I|_c}{|J^T V^{-1} J + I|_\emptyset} $$

the expected log Bayes factor between two explanations that c adds, and what it tells of theta
[nat].

Reference:
    Box and Hill, Discrimination among mechanistic models, Technometrics 9, 1967.
    Lindley, On a measure of the information provided by an experiment, Ann. Math. Stat. 27, 1956.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.score import Scores
from granulcal.loop.test.trace import Trace, fit_at

__all__ = ["Experiment", "next_experiment"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Experiment:
    """Further pours under one condition.

    Attributes:
        label: of the condition.
        rivals: the two explanations that it tells apart worst; empty if there are not two.
        gain: expected log Bayes factor between them [nat]; 0 if there are not two.
        theta_gain: expected gain of information on theta [nat].
    """

    label: str
    rivals: tuple[str, ...]
    gain: float
    theta_gain: float

    def to_dict(self) -> dict[str, Any]:
        """Returns it for JSON."""
        return {
            "condition": self.label,
            "rivals": list(self.rivals),
            "gain": self.gain,
            "theta_gain": self.theta_gain,
        }


def next_experiment(
    surrogate: Surrogate,
    found: Trace,
    candidates: Sequence[tuple[str, ArrayLike]],
    *,
    pours: int = 10,
) -> list[Experiment]:
    """Returns the candidates, the one with the largest gain first.

    Args:
        surrogate: of the archive.
        found: the trace whose rivals are to be distinguished.
        candidates: label and unit coordinates (q,) of each condition.
        pours: how many pours each would have.
    """
    names = [effect.name for effect in surrogate.design.effects]
    strengths = {
        one.effects[0]: float(one.best_strengths[0])
        for one in found.explanations
        if len(one.effects) == 1 and one.effects[0] in found.verdict.named
    }
    rivals = list(strengths)[:3]
    local, v = found.local, found.models[0].fit.v if found.models else found.local.v
    already, known = _gains(local, v, names, strengths, rivals)
    ranked = []
    for label, condition in candidates:
        at = np.atleast_1d(np.asarray(condition, dtype=np.float64))
        both = LinearisedSurrogate.at(
            surrogate,
            np.concatenate([local.conditions, at[None]]),
            np.append(local.counts, float(pours)),
            v,
            # In a session of its own.
            np.append(local.sessions, local.sessions.max() + 1),
        )
        gains, told = _gains(both, v, names, strengths, rivals)
        worst = min(gains, key=lambda pair: gains[pair] - already[pair]) if gains else ()
        gain = gains[worst] - already[worst] if worst else 0.0
        ranked.append(Experiment(label, worst, gain, told - known))
    return sorted(ranked, key=lambda one: (-one.gain, -one.theta_gain))


def _gains(
    local: LinearisedSurrogate,
    v: Array,
    names: list[str],
    strengths: dict[str, float],
    rivals: list[str],
) -> tuple[dict[tuple[str, ...], float], float]:
    """Expected log Bayes factor of each pair of rivals, and half the log determinant of theta."""
    effects = tuple(names.index(name) for name in rivals)
    scores = Scores.of(local, fit_at(local, v), effects)
    steps = [strengths[name] * scores.directions[:, i] for i, name in enumerate(rivals)]
    gains: dict[tuple[str, ...], float] = {}
    for i in range(len(rivals)):
        for j in range(i):
            gap = (steps[i] - steps[j])[:, None]
            gains[rivals[j], rivals[i]] = 0.5 * float(np.sum(gap * scores.remain(gap)))
    normal = scores.slopes.T @ scores.slopes + np.eye(len(v))
    return gains, 0.5 * float(np.linalg.slogdet(normal)[1])
