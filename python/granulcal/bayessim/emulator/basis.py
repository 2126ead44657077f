r"""Features of the parameters: a polynomial and random Fourier features with learnt length scales.

A function of the coordinates is $f(u) = \sum_j c_j \varphi_j(u)$ with
$\varphi = [a \cdot 1, a v, \cos \Omega v, \sin \Omega v]$, v the standardised coordinates: a
Gaussian process whose covariance is a constant, a linear and a Matern kernel, the last of them with
one length scale for each coordinate (Rasmussen and Williams 2006, sections 2.7 and 4.2). The
length scales maximise the summed evidence of all statistics.
"""

from dataclasses import dataclass
from functools import cache
from itertools import chain, combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

__all__ = ["Basis", "learn_length_scales"]

Array = NDArray[np.float64]

# Prior standard deviation of constant and slopes over that of the random features' sum.
_POLYNOMIAL = 3.0
_STEPS, _STEP = 40, 0.1
# More pairs than this do not change length scales worth the name.
_PAIRS = 500
# Prior of the log length scales, in standard deviations of the coordinates.
_LOG_LENGTH_MEAN, _LOG_LENGTH_SD = 0.8, 1.0


@dataclass(frozen=True)
class Basis:
    """Features of p coordinates.

    Attributes:
        centre: shape (p,).
        scale: shape (p,).
        frequencies: over the length scales already, shape (m, p).
        degree: of the polynomial, 1 or 2.
    """

    centre: Array
    scale: Array
    frequencies: Array
    degree: int = 1

    @classmethod
    def draw(
        cls, u: Array, length_scales: Array, *, features: int, seed: int, degree: int = 1
    ) -> "Basis":
        """Returns a basis for coordinates like `u` (n, p), length scales in their spreads."""
        spread = u.std(axis=0)
        base = _frequencies(features, u.shape[1], seed)
        return cls(u.mean(axis=0), np.where(spread > 0, spread, 1.0), base / length_scales, degree)

    def __call__(self, u: Array) -> Array:
        """Returns the features at `u` (n, p), shape (n, d)."""
        v = (u - self.centre) / self.scale
        phase = self.frequencies @ v.T
        terms, count = _terms(u.shape[1], self.degree), len(self.frequencies)
        # One feature after the other lies in memory, so that each is filled in one go.
        features = np.empty((len(terms) + 2 * count, len(u)))
        _fill_polynomial(v, terms, features)
        features[: len(terms)] *= _POLYNOMIAL
        waves = features[len(terms) :]
        np.cos(phase, out=waves[:count])
        np.sin(phase, out=waves[count:])
        waves *= count**-0.5
        return features.T


def polynomial(v: Array, degree: int) -> Array:
    """Returns all monomials of `v` (n, p) up to `degree`, the constant first."""
    terms = _terms(v.shape[1], degree)
    rows = np.empty((len(terms), len(v)))
    _fill_polynomial(v, terms, rows)
    return rows.T


@cache
def _terms(dimension: int, degree: int) -> tuple[tuple[int, ...], ...]:
    """Which coordinates each monomial multiplies."""
    powers = range(degree + 1)
    return tuple(
        chain.from_iterable(combinations_with_replacement(range(dimension), d) for d in powers)
    )


def _fill_polynomial(v: Array, terms: tuple[tuple[int, ...], ...], rows: Array) -> None:
    for term, row in zip(terms, rows, strict=False):
        row[:] = v[:, term[0]] if term else 1.0
        for i in term[1:]:
            row *= v[:, i]


def learn_length_scales(u: Array, z: Array, *, features: int, seed: int) -> Array:
    """Returns one length scale for each coordinate, in spreads of the coordinate, shape (p,).

    Args:
        u: coordinates, shape (n, p).
        z: statistics of spread 1, shape (n, s).
        features: random frequencies.
        seed: seed of the frequencies.
    """
    import torch

    from granulcal.bayessim.network.adam import Adam

    chosen = np.random.default_rng(seed).permutation(len(u))[:_PAIRS]
    spread = u.std(axis=0)
    v = (u[chosen] - u.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    targets = z[chosen] - z[chosen].mean(axis=0)
    log_length = np.full(v.shape[1], _LOG_LENGTH_MEAN)
    log_ratio = np.full(z.shape[1], -2.0)
    evidence = _Evidence(v, targets, _frequencies(features, v.shape[1], seed))
    # The tensors are views of the arrays.
    adam = Adam([torch.from_numpy(log_length), torch.from_numpy(log_ratio)])
    for _ in range(_STEPS):
        by_length, by_ratio = evidence.slopes(log_length, log_ratio)
        by_length += (log_length - _LOG_LENGTH_MEAN) / _LOG_LENGTH_SD**2
        adam.step([torch.from_numpy(by_length), torch.from_numpy(by_ratio)], _STEP)
    return np.exp(log_length)


@dataclass(frozen=True)
class _Evidence:
    r"""Slopes of the summed evidence, whose statistics have a ridge each.

    With the design F, $G = F^T F$, $A_j = (G + r_j I)^{-1}$, $c_j = A_j F^T y_j$ and
    $e_j = y_j^T y_j - y_j^T F c_j$ the negative log evidence is
    $\frac12 \sum_j n \log e_j + \log |G + r_j I| - d \log r_j$, and its slope along F is
    $F \sum_j A_j - \sum_j \frac{n}{e_j} (y_j - F c_j) c_j^T$.
    """

    v: Array
    targets: Array
    frequencies: Array

    def slopes(self, log_length: Array, log_ratio: Array) -> tuple[Array, Array]:
        """Returns the slopes along the log length scales (p,) and the log ridges (s,)."""
        ratio, scaled = np.exp(log_ratio), self.frequencies / np.exp(log_length)
        phase = self.v @ scaled.T
        count, half = phase.shape
        size = half**-0.5
        cos, sin = size * np.cos(phase), size * np.sin(phase)
        design = np.concatenate([_POLYNOMIAL * polynomial(self.v, 1), cos, sin], axis=1)
        values, vectors = np.linalg.eigh(design.T @ design)
        inverse = 1 / (np.maximum(values, 0.0)[:, None] + ratio)
        along = design.T @ self.targets
        solved = vectors @ (inverse * (vectors.T @ along))
        left = np.maximum(np.sum(self.targets**2, axis=0) - np.sum(along * solved, axis=0), 1e-12)
        residuals = (self.targets - design @ solved) * (count / left)
        slope = (design @ vectors * inverse.sum(axis=1)) @ vectors.T - residuals @ solved.T
        by_phase = slope[:, -half:] * cos - slope[:, -2 * half : -half] * sin
        by_length = -np.sum((by_phase.T @ self.v) * scaled, axis=0)
        traces = inverse.sum(axis=0) - len(values) / ratio
        by_ratio = 0.5 * ratio * (count / left * np.sum(solved**2, axis=0) + traces)
        return by_length, by_ratio


def _frequencies(count: int, dimension: int, seed: int) -> Array:
    from granulcal.bayessim.network.features import draw_frequencies

    return draw_frequencies(count, dimension, kernel="matern52", seed=seed).numpy()
