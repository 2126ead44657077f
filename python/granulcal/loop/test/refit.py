r"""Joint fits of parameters and strengths, compared by their evidence.

$$ Z_A = \int p(\psi_A) \int N(\bar z; m(v, \psi_A), V) N(v; 0, I) \, dv \, d\psi_A, \qquad
   \int \cdot \, dv \approx N(\bar z; \hat m, \hat V) N(\hat v; 0, I)
   \frac{(2 \pi)^{p / 2}}{|J^T V^{-1} J + I|^{1/2}} $$

V is the same for all parameters and strengths of a model: that of pours at the base fit and of the
surrogate's error at the model's best strength. A V that moved with them would speak through its
determinant, and with a hundred numbers 10 % of variance is worth 5 nat; what pours scatter is not
known that well.

One strength is integrated over its uniform prior, theta by Laplace's method at the best theta of
each node: strengths are bounded and ridges are bent, both of which a single normal gets wrong. A
grid of nodes is split where its log density changes much near its largest, for a camera's blur is
known to a hundredth of its range and falls by hundreds of nats from one node to the next; between
nodes the log density is the cubic that keeps to what is between their values. Two strengths take
Laplace's method jointly, the normal cut to the priors' box (`box.py`); where one is held at an end
of its prior, the normal has the slope of the density there, and its middle beyond. A model's log
probability adds the log of its prior share.

Reference:
    Tierney and Kadane, Accurate approximations for posterior moments, JASA 81, 1986.
    Fritsch and Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM
    Journal on Scientific and Statistical Computing 5, 1984 (slopes; with those of neighbours the
    cubic had its largest where there was none).
    MacKay, Information theory, inference and learning algorithms, 2003, chapters 27 and 28.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.surrogate.baseline import Fit, Start, improve
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.test.box import log_mass, marginal
from granulcal.loop.test.thresholds import Thresholds

__all__ = ["Model", "by_probability", "fit_none", "fit_pair", "fit_single", "interval", "root_at"]

Array = NDArray[np.float64]

_NODES = 17
_FINE = 1001
# Nodes are split while the log density changes by more than `_CHANGE` between two, one of which is
# within `_NEAR` of the largest [nat]; at most so often, and to so small a difference in strength.
_CHANGE, _NEAR = 1.0, 3.0
_SPLITS, _CLOSEST = 14, 2e-5
# Points between two nodes that are closer than those of `_FINE`.
_BETWEEN = 8


@dataclass(frozen=True)
class Model:
    """One explanation.

    Attributes:
        effects: indices of its effects, at most two.
        fit: its best fit.
        log_evidence: log Z [nat].
        log_probability: log Z plus log prior share [nat], not normalised.
        strengths: posterior mean of each strength, shape (|A|,).
        intervals: of each strength, shape (|A|, 2).
        at_end: whether a strength's posterior leans on the end of its prior.
        curve: of a single effect: strengths, and the log of its posterior there over its largest,
            shape (2, n); of other models empty.
    """

    effects: tuple[int, ...]
    fit: Fit
    log_evidence: float
    log_probability: float
    strengths: Array
    intervals: Array
    at_end: bool
    curve: Array


def by_probability(model: Model) -> float:
    """Returns what models are ordered by."""
    return model.log_probability


def fit_none(fit: Fit, thresholds: Thresholds) -> Model:
    """Returns the model without effects, from its fit."""
    log_evidence = _laplace(fit)
    return Model(
        (),
        fit,
        log_evidence,
        log_evidence + float(np.log(thresholds.null_share)),
        np.empty(0),
        np.empty((0, 2)),
        False,
        np.empty((2, 0)),
    )


def fit_single(
    local: LinearisedSurrogate,
    target: Array,
    base: Fit,
    k: int,
    thresholds: Thresholds,
    starts: Sequence[Start] = (),
) -> Model:
    """Returns the model with effect `k` alone.

    The best theta of each strength is sought from that of its neighbour, and from `starts`: those
    with this effect from their own strength outwards, those without any from no effect.
    """
    effect = local.surrogate.design.effects[k]
    nodes = np.linspace(effect.low, 1.0, 2 * _NODES - 1 if effect.is_two_sided else _NODES)
    known: dict[float, tuple[Fit, float]] = {}
    joint = _joint(local, target, base, (k,))
    root = root_at(local, base, joint.psi)

    def seek(at: float, v: Array, steps: int) -> Array:
        """Keeps the better fit of a strength, and returns where this one has gone."""
        psi = local.none()
        psi[k] = at
        found = improve(local, target, v, psi, (), root=root, steps=steps)
        before = known.get(at)
        if before is None or found.log_density > before[0].log_density:
            known[at] = found, _laplace(found)
        return found.v

    alone = [s for s in starts if not np.delete(s.psi - local.none(), k).any()]
    for begin in (Start(base.v, local.none()), *alone):
        # Outwards, each node from its neighbour.
        start = int(np.abs(nodes - begin.psi[k]).argmin())
        for path in (range(start, len(nodes)), range(start, -1, -1)):
            v = begin.v
            for i in path:
                v = seek(float(nodes[i]), v, 4)
    seek(float(joint.psi[k]), joint.v, 8)
    for _ in range(_SPLITS):
        at = sorted(known)
        pairs = _uneven(np.array(at), np.array([known[a][1] for a in at]))
        if not pairs:
            break
        for i in pairs:
            middle = 0.5 * (at[i] + at[i + 1])
            for end in (at[i], at[i + 1]):
                seek(middle, known[end][0].v, 8)
    at = sorted(known)
    logs = np.array([known[a][1] for a in at])
    close = [np.linspace(a, b, _BETWEEN) for a, b in pairwise(at) if b - a < nodes[1] - nodes[0]]
    fine = np.unique(np.concatenate([np.linspace(effect.low, 1.0, _FINE), *close]))
    density = _cubic(np.array(at), logs, fine)
    largest = float(density.max())
    weights = np.exp(density - largest)
    mass = _trapezoid(weights, fine)
    log_evidence = largest + float(np.log(mass / (1 - effect.low)))
    mean = _trapezoid(weights * fine, fine) / mass
    curve = np.stack([fine, density - largest])
    best = float(fine[int(density.argmax())])
    psi = local.none()
    psi[k] = best
    v = known[min(at, key=lambda a: abs(a - best))][0].v
    fit = improve(local, target, v, psi, (k,))
    count = len(local.surrogate.design.candidates)
    return Model(
        (k,),
        fit,
        log_evidence,
        log_evidence + float(np.log(thresholds.single_share / count)),
        np.array([mean]),
        np.array([interval(curve, thresholds.level)]),
        bool(weights[-1] > 0.2 or (effect.is_two_sided and weights[0] > 0.2)),
        curve,
    )


def interval(curve: Array, level: float, stretch: float = 1.0) -> tuple[float, float]:
    """Returns the central interval of a strength's posterior, stretched.

    Args:
        curve: strengths and log density, shape (2, n).
        level: probability between its ends.
        stretch: tau: the density is taken to the power 1 / tau^2, which stretches a normal by tau.
    """
    at, weights = curve[0], np.exp((curve[1] - curve[1].max()) / stretch**2)
    steps = np.concatenate([[0.0], np.cumsum((weights[1:] + weights[:-1]) / 2 * np.diff(at))])
    tail = (1 - level) / 2
    low, high = np.interp([tail, 1 - tail], steps / steps[-1], at)
    return float(low), float(high)


def fit_pair(
    local: LinearisedSurrogate,
    target: Array,
    base: Fit,
    start: Fit,
    pair: tuple[int, int],
    thresholds: Thresholds,
) -> Model:
    """Returns the model with two effects, from the base fit and a fit with one of them."""
    best = _joint(local, target, start, pair)
    fit = improve(
        local, target, best.v, best.psi, pair, root=root_at(local, base, best.psi), steps=16
    )
    effects = local.surrogate.design.effects
    low = np.array([effects[k].low for k in pair])
    white = np.linalg.solve(fit.root, np.column_stack([fit.slopes, fit.residual]))
    white, rest = white[:, :-1], white[:, -1]
    p, centre = len(fit.v), fit.psi[list(pair)]
    precision = np.concatenate([np.ones(p), np.full(2, 1e-6)])
    normal = white.T @ white + np.diag(precision)
    covariance = np.asarray(np.linalg.inv(normal), dtype=np.float64)
    # At an end of a prior the density still rises outwards: its largest is no maximum there, and
    # the normal that has this slope at the end has its middle beyond.
    is_held = np.concatenate([np.zeros(p, dtype=bool), (centre <= low) | (centre >= 1)])
    rise = np.where(is_held, white.T @ rest, 0.0)
    middle = centre + (covariance @ rise)[p:]
    log_evidence = fit.log_density + 0.5 * len(normal) * float(np.log(2 * np.pi))
    log_evidence += 0.5 * float(rise @ covariance @ rise - np.linalg.slogdet(normal)[1])
    log_evidence += log_mass(middle, covariance[p:, p:], low) - float(np.log(1 - low).sum())
    curves = [marginal(middle, covariance[p:, p:], low, i) for i in (0, 1)]
    count = comb(len(local.surrogate.design.candidates), 2)
    left = 1 - thresholds.null_share - thresholds.single_share
    return Model(
        pair,
        best,
        log_evidence,
        log_evidence + float(np.log(left / count)),
        np.array([_mean(curve) for curve in curves]),
        np.array([interval(curve, thresholds.level) for curve in curves]),
        bool((np.where(low < 0, abs(centre), centre) > 0.98).any()),
        np.empty((2, 0)),
    )


def _joint(local: LinearisedSurrogate, target: Array, start: Fit, active: tuple[int, ...]) -> Fit:
    """Best fit of theta and strengths together, V moving with them."""
    psi = start.psi.copy()
    for k in active:
        if psi[k] == 0:
            psi[k] = 0.2
    return improve(local, target, start.v, psi, active, steps=16)


def root_at(local: LinearisedSurrogate, base: Fit, psi: Array) -> Array:
    """Returns the root of V at strengths (K,): pours of the base fit, the surrogate's error."""
    none = local.none()
    total = local.pour_covariance(base.v, none) + local.nuisance
    covariance = total + local.error_covariance(base.v, psi)
    return np.asarray(np.linalg.cholesky(covariance), dtype=np.float64)


def _laplace(fit: Fit) -> float:
    """Log integral over theta at the strengths of a fit."""
    p = len(fit.v)
    white = np.linalg.solve(fit.root, fit.slopes[:, :p])
    log_det = float(np.linalg.slogdet(white.T @ white + np.eye(p))[1])
    return fit.log_density + 0.5 * p * float(np.log(2 * np.pi)) - 0.5 * log_det


def _uneven(at: Array, logs: Array) -> list[int]:
    """Returns after which of nodes (n,) another is wanted, by their log density (n,)."""
    change, width = np.abs(np.diff(logs)), np.diff(at)
    near = np.maximum(logs[1:], logs[:-1]) > logs.max() - _NEAR
    return np.nonzero((change > _CHANGE) & near & (width > _CLOSEST))[0].tolist()


def _cubic(x: Array, y: Array, at: Array) -> Array:
    """Piecewise cubic interpolation on nodes (n,) that rise, between the values of neighbours."""
    i = np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2)
    widths = np.diff(x)
    rises = np.diff(y) / widths
    # Harmonic means of the rises to either side, nothing at a peak.
    before, after = 2 * widths[1:] + widths[:-1], widths[1:] + 2 * widths[:-1]
    is_along = rises[:-1] * rises[1:] > 0
    one, other = np.where(is_along, rises[:-1], 1.0), np.where(is_along, rises[1:], 1.0)
    inner = np.where(is_along, (before + after) / (before / one + after / other), 0.0)
    slopes = np.concatenate([rises[:1], inner, rises[-1:]])
    width = widths[i]
    t = (at - x[i]) / width
    a = (1 + 2 * t) * (1 - t) ** 2 * y[i] + t * (1 - t) ** 2 * width * slopes[i]
    return a + t**2 * (3 - 2 * t) * y[i + 1] + t**2 * (t - 1) * width * slopes[i + 1]


def _mean(curve: Array) -> float:
    """The mean of a strength's posterior, strengths and log density of shape (2, n)."""
    at, weights = curve[0], np.exp(curve[1] - curve[1].max())
    return _trapezoid(weights * at, at) / _trapezoid(weights, at)


def _trapezoid(y: Array, x: Array) -> float:
    return float(np.sum((y[1:] + y[:-1]) / 2 * np.diff(x)))
