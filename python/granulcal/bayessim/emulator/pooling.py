"""Scales of the noise of several pours of one material, and what of it averages away."""

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.emulator import Prediction

__all__ = ["averaging_share", "linear_scores", "pooled_scales"]

Array = NDArray[np.float64]

# One axis alone does not say that all noise is the pours' own.
_LARGEST_RATIO = 2.0


def averaging_share(y: Array, scales: Array) -> Array:
    r"""Returns the share of the noise that k pours have each for themselves, shape (n,).

    $$ \eta = \min(1, (1 + 2 \sqrt{2 / r (k-1)}) \, \mathrm{mean}_j \min(w_j^2 / s_j^2, 2)) $$

    with $w_j$ the standard deviation between the pours: what the emulator calls noise and pours of
    one material do not differ by is an error of the emulator. The factor is two standard deviations
    of such a mean of $r (k-1)$ squares, so that noise that is all the pours' own counts as that.

    Args:
        y: signal axes of the pours, shape (k, r).
        scales: what the emulator calls noise, shape (n, r).
    """
    pours, axes = y.shape
    if pours == 1:
        return np.ones(len(scales))
    ratios = np.minimum(y.var(axis=0, ddof=1) / scales**2, _LARGEST_RATIO)
    doubt = 1 + 2 * np.sqrt(2 / (axes * (pours - 1)))
    return np.minimum(1.0, doubt * ratios.mean(axis=1))


def pooled_scales(
    prediction: Prediction, pours: int, widening: float, share: Array | float = 1.0
) -> Array:
    """Returns the square root of V_k at each predicted point, shape (n, s).

    Args:
        prediction: what is expected there.
        pours: k.
        widening: c.
        share: of the noise that averages away, shape (n,) or a number.
    """
    noise, unknown = prediction.scales**2, prediction.unknown**2
    own = noise * np.reshape(share, (-1, 1))
    return np.sqrt(widening**2 * (noise + unknown) - (1 - 1 / pours) * own)


def linear_scores(u: Array, z: Array, train: NDArray[np.intp], held: NDArray[np.intp]) -> Array:
    """Returns log densities of held parameters by linear regression on the statistics, (h,)."""
    rows = np.column_stack([z, np.ones(len(z))])
    gram = rows[train].T @ rows[train] + np.eye(rows.shape[1])
    errors = u - rows @ np.linalg.solve(gram, rows[train].T @ u[train])
    covariance = errors[train].T @ errors[train] / len(train) + 1e-9 * np.eye(u.shape[1])
    white = np.linalg.solve(np.linalg.cholesky(covariance), errors[held].T)
    return -0.5 * (np.sum(white**2, axis=0) + np.linalg.slogdet(2 * np.pi * covariance)[1])
