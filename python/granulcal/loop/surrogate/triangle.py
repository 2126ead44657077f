"""The root of a posterior covariance, from its precision matrix."""

import numpy as np
from numpy.typing import NDArray

from granulcal.one_thread import one_thread

__all__ = ["root_of", "times_triangle"]

Array = NDArray[np.float64]


def root_of(precision: Array) -> Array:
    """Returns B, upper triangular, with B B^T the inverse of a positive definite matrix (d, d).

    B = L^-T of the precision L L^T, by LAPACK's potrf and trtri: two thirds of what the inverse
    itself takes, and sums of squares of B's rows are all that a fit asks of it. SciPy's give the
    same bits wherever the matrix lies in memory, PyTorch's (MKL) do not.

    Args:
        precision: symmetric, contiguous by rows; it is overwritten.
    """
    from scipy.linalg import get_lapack_funcs

    potrf, trtri = get_lapack_funcs(("potrf", "trtri"), (precision,))
    # Once more: SciPy may have come just now.
    with one_thread():
        factor, failed = potrf(precision.T, lower=1, clean=1, overwrite_a=1)
        inverse, failed_too = trtri(factor, lower=1, overwrite_c=1)
    if failed or failed_too:
        raise np.linalg.LinAlgError("the precision matrix is not positive definite")
    return np.asarray(inverse.T, dtype=np.float64)


def times_triangle(rows: Array, triangle: Array, factor: float) -> Array:
    """Returns `factor` times `rows` (n, d) times an upper triangle (d, d).

    Both are contiguous by rows, and `rows` is overwritten.
    """
    from scipy.linalg import get_blas_funcs

    if len(rows) == 0:
        return rows
    (trmm,) = get_blas_funcs(("trmm",), (rows, triangle))
    with one_thread():
        product = trmm(factor, triangle.T, rows.T, lower=1, overwrite_b=1)
    return np.asarray(product.T, dtype=np.float64)
