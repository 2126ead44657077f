"""The inverse of a covariance or of a precision matrix."""

import numpy as np
from numpy.typing import NDArray

from granulcal.one_thread import one_thread

__all__ = ["inverse_of"]

Array = NDArray[np.float64]


def inverse_of(matrix: Array) -> Array:
    """Returns the inverse of a positive definite matrix (d, d).

    By LAPACK's potrf and potri, a quarter of the work by LU; numpy has no potri. SciPy's give the
    same bits wherever the matrix lies in memory, PyTorch's (MKL) do not.
    """
    from scipy.linalg import get_lapack_funcs

    potrf, potri = get_lapack_funcs(("potrf", "potri"), (matrix,))
    # Once more: SciPy may have come just now.
    with one_thread():
        factor, failed = potrf(matrix, lower=1, clean=0)
        lower, failed_too = potri(factor, lower=1)
    if failed or failed_too:
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    below = np.tril(lower, -1)
    return np.asarray(below + below.T + np.diag(np.diag(lower)), dtype=np.float64)
