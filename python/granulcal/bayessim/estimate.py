r"""Estimates of the parameters from one vector of statistics: the network's inputs.

Sixteen statistics repeat each other, and no density of them fits well from a few hundred pairs.
Their posterior mean alone is a sufficient summary where the posterior is nearly normal, and the best
summary of that size for squared error anywhere (Fearnhead and Prangle 2012). Two estimates of it are
made and joined:

- a ridge regression of the coordinates on random features of the statistics;
- the mean of the posterior under an emulator of all statistics, its likelihood tempered.

The first needs no noise model, the second needs fewer pairs. Each is made for a training pair from
the other pairs alone, so that what follows sees them as they will be for a new observation: errors
of the emulator cost sharpness and not calibration.

Reference:
    Fearnhead and Prangle, Constructing summary statistics for approximate Bayesian computation,
    JRSS B 74, 2012.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.density import quasi_normal
from granulcal.bayessim.emulator import Emulator
from granulcal.bayessim.features import draw_frequencies
from granulcal.bayessim.ridge import Ridge

__all__ = ["Estimator", "Regression"]

Array = NDArray[np.float64]

_LENGTHS = (0.5, 1.0, 2.0)
_LINEAR = 3.0
_POINTS = 128
_SPREAD = 1.5
_POWERS = (0.1, 0.2, 0.35, 0.6, 1.0)


@dataclass(frozen=True)
class Regression:
    """Coordinates from standardised statistics, by random features of them.

    Attributes:
        frequencies: one set for each length scale, shape (b, m, s).
        length: which set a coordinate uses, shape (p,).
        coefficients: shape (p, 1 + s + 2 m).
        centre: mean of the training coordinates, shape (p,).
    """

    frequencies: Array
    length: NDArray[np.intp]
    coefficients: Array
    centre: Array

    @classmethod
    def fit(cls, u: Array, z: Array, *, features: int, seed: int) -> tuple["Regression", Array]:
        """Returns the regression of `u` (n, p) on `z` (n, s) and each pair's estimate left out."""
        base = draw_frequencies(features, z.shape[1], kernel="matern52", seed=seed).numpy()
        sets = np.stack([base / (length * np.sqrt(2 * z.shape[1])) for length in _LENGTHS])
        centre = u.mean(axis=0)
        ridges = [Ridge(_features(z, frequencies)) for frequencies in sets]
        length = np.zeros(u.shape[1], dtype=np.intp)
        rows, left_out = [], np.empty_like(u)
        for i, target in enumerate((u - centre).T):
            fits = [ridge.fit(target) for ridge in ridges]
            length[i] = int(np.argmax([fit.log_evidence for fit in fits]))
            best = fits[length[i]]
            rows.append(best.coefficients)
            left_out[:, i] = u[:, i] - best.loo_residuals(target)
        return cls(sets, length, np.array(rows), centre), left_out

    def __call__(self, z: Array) -> Array:
        """Returns estimates from `z` (n, s), shape (n, p)."""
        result = np.empty((len(z), len(self.length)))
        for number, frequencies in enumerate(self.frequencies):
            mine = self.length == number
            if mine.any():
                result[:, mine] = _features(z, frequencies) @ self.coefficients[mine].T
        return result + self.centre


def _features(z: Array, frequencies: Array) -> Array:
    phase = z @ frequencies.T
    size = len(frequencies) ** -0.5
    linear = _LINEAR / np.sqrt(z.shape[1]) * z
    ones = np.full((len(z), 1), _LINEAR)
    return np.concatenate([ones, linear, size * np.cos(phase), size * np.sin(phase)], axis=1)


@dataclass(frozen=True)
class Estimator:
    """Joined estimates.

    Attributes:
        regression: the direct estimate.
        emulator: of all standardised statistics.
        root: lower triangular; root root^T is the covariance of the direct estimate's error.
        power: tempering of the emulator's likelihood.
        weights: of [1, direct, emulated], shape (1 + 2 p, p).
        bounds: of the coordinates, shape (p, 2).
    """

    regression: Regression
    emulator: Emulator
    root: Array
    power: float
    weights: Array
    bounds: Array

    @classmethod
    def fit(
        cls, u: Array, z: Array, bounds: Array, *, features: int, seed: int
    ) -> tuple["Estimator", Array]:
        """Returns the estimator of pairs `u` (n, p), `z` (n, s) and each pair's estimate left out."""
        regression, direct = Regression.fit(u, z, features=features, seed=seed)
        errors = u - direct
        root = np.linalg.cholesky(errors.T @ errors / len(u) + 1e-12 * np.eye(u.shape[1]))
        emulator = Emulator.fit(u, z, features=features // 4, varying_scale=False, seed=seed)
        cells = _cells(direct, root, bounds)
        fits = _log_likelihoods(emulator, z, cells, left_out=True)
        best = None
        for power in _POWERS:
            emulated = _mean(cells, power * fits)
            joined = np.concatenate([np.ones((len(u), 1)), direct, emulated], axis=1)
            gram = joined.T @ joined + 1e-6 * len(u) * np.eye(joined.shape[1])
            weights = np.linalg.solve(gram, joined.T @ u)
            error = float(np.sum(np.mean((joined @ weights - u) ** 2, axis=0) / u.var(axis=0)))
            if best is None or error < best[0]:
                best = error, power, weights, joined @ weights
        assert best is not None
        return cls(regression, emulator, root, best[1], best[2], bounds), best[3]

    def __call__(self, z: Array) -> Array:
        """Returns estimates from standardised statistics `z` (n, s), shape (n, p)."""
        direct = self.regression(z)
        cells = _cells(direct, self.root, self.bounds)
        emulated = _mean(cells, self.power * _log_likelihoods(self.emulator, z, cells))
        return np.concatenate([np.ones((len(z), 1)), direct, emulated], axis=1) @ self.weights


def _cells(centres: Array, root: Array, bounds: Array) -> Array:
    """Points around each centre, inside the bounds, shape (n, points, p)."""
    points = _SPREAD * quasi_normal(_POINTS, centres.shape[1]) @ root.T
    return np.clip(centres[:, None] + points, bounds[:, 0], bounds[:, 1])


def _mean(cells: Array, log_weights: Array) -> Array:
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    return np.einsum("nc,ncp->np", weights, cells)


def _log_likelihoods(
    emulator: Emulator, z: Array, cells: Array, *, left_out: bool = False
) -> Array:
    """Log likelihood of each row of `z` (n, s) at its cells (n, c, p), shape (n, c)."""
    count, points, _ = cells.shape
    result = np.empty((count, points))
    # Blocks bound the memory of the features.
    for start in range(0, count, 64):
        block = slice(start, min(start + 64, count))
        flat = cells[block].reshape(-1, cells.shape[2])
        prediction = emulator.predict(flat)
        means = prediction.means.reshape(-1, points, z.shape[1])
        if left_out:
            means = means + emulator.spread * _changes(emulator, flat, block, points)
        scales = np.hypot(prediction.scales, prediction.unknown)
        deviations = (z[block, None] - means).reshape(len(flat), -1)
        result[block] = emulator.noise.log_density(deviations, scales).reshape(-1, points)
    return result


def _changes(emulator: Emulator, flat: Array, block: slice, points: int) -> Array:
    """Change of the means at each pair's own cells when that pair is left out."""
    assert emulator.leftover is not None
    influence = emulator.leftover.influence[:, block]
    changes = np.empty((influence.shape[1], points, len(emulator.base)))
    for number, basis in enumerate(emulator.bases):
        mine = np.flatnonzero(emulator.base == number)
        if len(mine):
            design = basis(flat).reshape(-1, points, influence.shape[2])
            changes[..., mine] = np.einsum("ncd,jnd->ncj", design, influence[mine], optimize=True)
    return changes
