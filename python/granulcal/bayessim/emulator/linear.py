"""Held-out scores of a linear regression, beside which those of the emulator stand."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["linear_scores"]

Array = NDArray[np.float64]


def linear_scores(u: Array, z: Array, train: NDArray[np.intp], held: NDArray[np.intp]) -> Array:
    """Returns log densities of held parameters by linear regression on the statistics, (h,)."""
    rows = np.column_stack([z, np.ones(len(z))])
    gram = rows[train].T @ rows[train] + np.eye(rows.shape[1])
    errors = u - rows @ np.linalg.solve(gram, rows[train].T @ u[train])
    covariance = errors[train].T @ errors[train] / len(train) + 1e-9 * np.eye(u.shape[1])
    white = np.linalg.solve(np.linalg.cholesky(covariance), errors[held].T)
    return -0.5 * (np.sum(white**2, axis=0) + np.linalg.slogdet(2 * np.pi * covariance)[1])
