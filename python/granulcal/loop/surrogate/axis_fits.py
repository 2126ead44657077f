r"""The fits of all axes: mean, scale and what readings of a pour share.

Each axis is fitted twice, first as if all rows had one scale; the scale and the share of the noise
$\rho$ that its residuals show are those of the second fit. All first fits come before the second
ones: they share their features, which are then let go.

Reference:
    Smyth, Generalized linear models with varying dispersion, JRSS B 51, 1989 (log scales).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.noise import fit_log_scale
from granulcal.loop.surrogate.blocks import fit_bordered
from granulcal.loop.surrogate.bordered import Features
from granulcal.loop.surrogate.readings import Readings
from granulcal.loop.surrogate.roots import Roots
from granulcal.progress import steps

__all__ = ["AxisFits"]

Array = NDArray[np.float64]

# What readings of one pour share of its noise before residuals have told it.
_SHARED = 0.5


@dataclass(frozen=True)
class AxisFits:
    """What the archive says of m axes.

    Attributes:
        coefficients: of the mean, shape (m, d).
        roots: of their posterior covariances.
        scale_coefficients: shape (m, e).
        scales: of each row, shape (n, m).
        white: whitened residual of each row under the fit to the others, shape (n, m).
        noise: the same, of the scale of the noise alone, shape (n, m).
        dof: pours less coefficients that they decided, mean over axes.
    """

    coefficients: Array
    roots: Roots
    scale_coefficients: Array
    scales: Array
    white: Array
    noise: Array
    dof: float

    @classmethod
    def of(
        cls, x: Features, blocks: list[slice], scale_columns: Array, y: Array, readings: Readings
    ) -> "AxisFits":
        """Returns the fits of `y` (n, m).

        Args:
            x: features of the mean.
            blocks: columns of `x` that share a prior width, together all of them.
            scale_columns: features of the logarithm of the scale, shape (n, e).
            y: rows on the axes.
            readings: which of the rows are of one pour.
        """
        count, size = y.shape
        first, shares = _first(x, blocks, scale_columns, y, readings)
        roots = Roots.room(x.bordering, size)
        coefficients = np.empty((size, roots.width))
        scale_coefficients = np.empty((size, scale_columns.shape[1]))
        white, noise, scales = np.empty((3, count, size))
        dof = 0.0
        for j in steps("surrogate", range(size)):
            rho, scale = shares[j], first[:, j]
            apart = x.apart(readings, rho, scale)
            target = readings.apart(y[:, j], rho, scale)
            fit = fit_bordered(apart, target, blocks, apart.gram)
            left = scale * readings.together(fit.noise, rho)
            scale_coefficients[j] = fit_log_scale(scale_columns, left)
            scales[:, j] = np.exp(scale_columns @ scale_coefficients[j])
            coefficients[j] = fit.coefficients
            roots.keep(fit.root, j)
            white[:, j] = scale * readings.together(fit.left_out, rho) / scales[:, j]
            noise[:, j] = left / scales[:, j]
            dof += (fit.dof - (count - len(readings.counts))) / size
        noise /= np.sqrt(np.mean(np.clip(noise, -6, 6) ** 2, axis=0))
        return cls(coefficients, roots, scale_coefficients, scales, white, noise, dof)


def _first(
    x: Features, blocks: list[slice], scale_columns: Array, y: Array, readings: Readings
) -> tuple[Array, list[float]]:
    """Scale of each row (n, m) and rho of each axis by fits to rows of one scale."""
    apart = x.apart(readings, _SHARED)
    gram = apart.gram
    scales, shares = np.empty(y.shape), []
    for j in steps("scales", range(y.shape[1])):
        fit = fit_bordered(apart, readings.apart(y[:, j], _SHARED), blocks, gram)
        left = readings.together(fit.noise, _SHARED)
        scales[:, j] = np.exp(scale_columns @ fit_log_scale(scale_columns, left))
        shares.append(readings.shared(left / scales[:, j]))
    return scales, shares
