r"""Random Fourier features: a kernel as an average over frequencies drawn from its spectrum.

A stationary kernel is $k(x - y) = E_\omega \cos(\omega^T (x - y))$ with $\omega$ drawn from the
kernel's spectral density, so cosines and sines of a few hundred frequencies replace the kernel.
The Matern kernel of smoothness $\nu$ has a multivariate Student t with $2\nu$ degrees of freedom
as its spectral density: a Gaussian vector over the root of an independent $\chi^2_{2\nu}/2\nu$.

Reference:
    Rahimi and Recht, Random features for large-scale kernel machines, NeurIPS 2007.
    Rasmussen and Williams, Gaussian processes for machine learning, 2006, equation (4.15).
"""

import torch

__all__ = ["draw_frequencies", "fourier_features", "waves"]

_MATERN_DEGREES_OF_FREEDOM = {"matern12": 1.0, "matern32": 3.0, "matern52": 5.0}
# Sobol points may touch 0 or 1, where the inverse normal is infinite.
_EDGE = 1e-6


def draw_frequencies(count: int, dimension: int, *, kernel: str, seed: int) -> torch.Tensor:
    """Returns quasi-random frequencies of a kernel with unit length scale.

    Args:
        count: number of frequencies.
        dimension: number of inputs.
        kernel: `rbf`, `matern12`, `matern32` or `matern52`.
        seed: seed of the Sobol points' scrambling.

    Returns:
        Frequencies [1 / input unit], float64, shape (count, dimension).
    """
    degrees = _MATERN_DEGREES_OF_FREEDOM.get(kernel)
    columns = dimension if degrees is None else dimension + 1
    # Torch takes half of the seeds that we do.
    sobol = torch.quasirandom.SobolEngine(columns, scramble=True, seed=seed % 2**63)
    points = sobol.draw(count, dtype=torch.float64).clamp(_EDGE, 1 - _EDGE)
    gaussian = torch.special.ndtri(points[:, :dimension])
    if degrees is None:
        return gaussian
    chi2 = _chi2_quantile(points[:, dimension], degrees)
    return gaussian / torch.sqrt(chi2 / degrees)[:, None]


def fourier_features(x: torch.Tensor, frequencies: torch.Tensor) -> torch.Tensor:
    """Returns features whose inner products approximate the kernel.

    Args:
        x: inputs, shape (..., n, d).
        frequencies: shape (..., m, d).

    Returns:
        Cosines, then sines, over the root of m; shape (..., n, 2 m).
    """
    return frequencies.shape[-2] ** -0.5 * waves(x, frequencies)


def waves(x: torch.Tensor, frequencies: torch.Tensor) -> torch.Tensor:
    """Returns cosines, then sines, of size one; otherwise as `fourier_features`."""
    phase = x @ frequencies.transpose(-1, -2)
    return torch.cat([torch.cos(phase), torch.sin(phase)], dim=-1)


def _chi2_quantile(probability: torch.Tensor, degrees: float) -> torch.Tensor:
    """Inverse of the chi-square distribution function, by bisection to the last bit."""
    low = torch.zeros_like(probability)
    # Far above the quantile of 1 - _EDGE for the few degrees of freedom used here.
    high = torch.full_like(probability, 200.0)
    shape = torch.full_like(probability, degrees / 2)
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = torch.special.gammainc(shape, middle / 2) < probability
        low, high = torch.where(below, middle, low), torch.where(below, high, middle)
    return 0.5 * (low + high)
