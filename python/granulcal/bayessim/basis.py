r"""Features of the parameters: a polynomial and random Fourier features with learnt length scales.

A function of the coordinates is $f(u) = \sum_j c_j \varphi_j(u)$ with
$\varphi = [a \cdot 1, a v, \cos \Omega v, \sin \Omega v]$, v the standardised coordinates: a
Gaussian process whose covariance is a constant, a linear and a Matern kernel, the last of them with
one length scale for each coordinate (Rasmussen and Williams 2006, sections 2.7 and 4.2). The
length scales maximise the summed evidence of all statistics.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

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
        phase = v @ self.frequencies.T
        size = len(self.frequencies) ** -0.5
        parts = [
            _POLYNOMIAL * polynomial(v, self.degree),
            size * np.cos(phase),
            size * np.sin(phase),
        ]
        return np.concatenate(parts, axis=1)


def polynomial(v: Array, degree: int) -> Array:
    """Returns all monomials of `v` (n, p) up to `degree`, the constant first."""
    columns = [np.ones(len(v))]
    for power in range(1, degree + 1):
        for term in combinations_with_replacement(range(v.shape[1]), power):
            column = v[:, term[0]]
            for i in term[1:]:
                column = column * v[:, i]
            columns.append(column)
    return np.stack(columns, axis=1)


def learn_length_scales(u: Array, z: Array, *, features: int, seed: int) -> Array:
    """Returns one length scale for each coordinate, in spreads of the coordinate, shape (p,).

    Args:
        u: coordinates, shape (n, p).
        z: statistics of spread 1, shape (n, s).
        features: random frequencies.
        seed: seed of the frequencies.
    """
    import torch

    chosen = np.random.default_rng(seed).permutation(len(u))[:_PAIRS]
    spread = u.std(axis=0)
    v = (u[chosen] - u.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    count, dimension = v.shape
    inputs = torch.from_numpy(v)
    targets = torch.from_numpy(z[chosen] - z[chosen].mean(axis=0))
    fixed = torch.from_numpy(_POLYNOMIAL * polynomial(v, 1))
    frequencies = torch.from_numpy(_frequencies(features, dimension, seed))
    log_length = torch.full((dimension,), _LOG_LENGTH_MEAN, dtype=torch.float64, requires_grad=True)
    log_ratio = torch.full((z.shape[1],), -2.0, dtype=torch.float64, requires_grad=True)
    optimizer = torch.optim.Adam([log_length, log_ratio], lr=_STEP)
    squares = targets.square().sum(0)
    identity = torch.eye(fixed.shape[1] + 2 * features, dtype=torch.float64)
    for _ in range(_STEPS):
        phase = inputs @ (frequencies / log_length.exp()).T
        waves = torch.cat([phase.cos(), phase.sin()], dim=1) * features**-0.5
        design = torch.cat([fixed, waves], dim=1)
        gram, along = design.T @ design, design.T @ targets
        ratio = log_ratio.exp()
        # One factorisation for each statistic, for each has a ridge of its own.
        factors = torch.linalg.cholesky(gram + ratio[:, None, None] * identity)
        half = torch.linalg.solve_triangular(factors, along.T[..., None], upper=False)
        left = (squares - half.square().sum((1, 2))).clamp_min(1e-12)
        log_det = 2 * torch.diagonal(factors, dim1=1, dim2=2).log().sum(1)
        log_det = log_det - len(identity) * log_ratio
        loss = 0.5 * (count * left.log() + log_det).sum()
        loss = loss + 0.5 * ((log_length - _LOG_LENGTH_MEAN) / _LOG_LENGTH_SD).square().sum()
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        optimizer.step()
    return log_length.detach().exp().numpy()


def _frequencies(count: int, dimension: int, seed: int) -> Array:
    from granulcal.bayessim.features import draw_frequencies

    return draw_frequencies(count, dimension, kernel="matern52", seed=seed).numpy()
