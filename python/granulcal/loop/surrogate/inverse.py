"""The inverse of a precision matrix."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["inverse_of"]

Array = NDArray[np.float64]


def inverse_of(precision: Array) -> Array:
    """Returns the inverse of a positive definite matrix (d, d).

    By LAPACK's potrf and potri, a quarter of the work by LU; numpy has no potri.
    """
    import torch

    factor = torch.linalg.cholesky(torch.from_numpy(precision))
    return torch.cholesky_inverse(factor).numpy()
