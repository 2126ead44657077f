"""Features of the surrogate, and the axes of uncorrelated noise that it stands on."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.basis import Basis, polynomial
from granulcal.loop.effects.design import Design
from granulcal.loop.surrogate.leading import LeadingBasis
from granulcal.loop.surrogate.roots import Roots

__all__ = [
    "CURVES",
    "crossed_columns",
    "crossed_effects",
    "curve_columns",
    "curve_width",
    "curved_columns",
    "curved_effects",
    "effect_columns",
    "fold_curve",
    "held_residuals",
    "lack_of_fit",
    "mean_columns",
    "noise_correlation",
    "scale_columns",
    "uncorrelated_axes",
]

Array = NDArray[np.float64]

# Share of the correlation that is replaced by none.
_SHRINKAGE = 0.03
# Whitened residuals are held within this many standard deviations where they make covariances.
_LARGEST_RESIDUAL = 6.0
# Pairs of near rows that show what the features cannot follow.
_LACK_ROWS, _NEIGHBOURS = 2000, 4
# Prior standard deviations of constant, slopes and curvatures of an effect, before its own width.
_CONSTANT, _SLOPE, _CURVATURE = 1.0, 0.5, 0.25
# Fewest rows that say what two effects do together.
_CROSSED_ROWS = 4
CURVES = 12
"""Sines of an effect that has a curve, half of them for each side of a two-sided one."""
# Fewest rows of an effect that show a curve.
_CURVED_ROWS = 300


def held_residuals(noise: Array) -> Array:
    """Residuals cut where they are no noise any more."""
    largest = _LARGEST_RESIDUAL * float(np.median(np.abs(noise)) / 0.6745)
    return np.clip(noise, -largest, largest)


def lack_of_fit(
    basis: LeadingBasis, u: Array, features: Array, roots: Roots, white: Array, scales: Array
) -> Array:
    """Lambda of each axis; pairs are each of up to `_LACK_ROWS` rows with its nearest."""
    v = u * basis.rates
    chosen = np.random.default_rng(0).permutation(len(u))[:_LACK_ROWS]
    gaps = np.sum(v[chosen] ** 2, axis=1)[:, None] + np.sum(v**2, axis=1) - 2 * v[chosen] @ v.T
    gaps[np.arange(len(chosen)), chosen] = np.inf
    near = np.argpartition(gaps, _NEIGHBOURS, axis=1)[:, :_NEIGHBOURS]
    held = np.clip(white, -_LARGEST_RESIDUAL, _LARGEST_RESIDUAL)
    products = np.mean(held[chosen][:, None] * held[near], axis=(0, 1))
    shared = np.empty(len(products))
    for j in range(len(roots)):
        along = roots.times(features, j) / scales[:, j : j + 1]
        each = [np.einsum("ij,ij->i", along[chosen], along[beside]) for beside in near.T]
        shared[j] = np.mean(each)
    return np.maximum(products + shared, 0.0)


def uncorrelated_axes(z: Array, quadratic: Array) -> Array:
    """C^-1/2 of what a quadratic leaves, C shrunk a little to its diagonal."""
    hat = np.linalg.qr(quadratic)[0]
    left = z - hat @ (hat.T @ z)
    held = np.clip(left / left.std(axis=0), -_LARGEST_RESIDUAL, _LARGEST_RESIDUAL)
    moment = (held * left.std(axis=0)).T @ (held * left.std(axis=0)) / len(z)
    moment = (1 - _SHRINKAGE) * moment + _SHRINKAGE * np.diag(np.diag(moment))
    values, vectors = np.linalg.eigh(moment)
    return (vectors / np.sqrt(values)) @ vectors.T


def mean_columns(
    basis: LeadingBasis,
    u: Array,
    psi: Array,
    bent: NDArray[np.bool_],
    crossed: Sequence[tuple[int, int]] = (),
    inputs: int = 0,
    curved: Sequence[tuple[int, bool]] = (),
) -> tuple[Array, list[slice]]:
    """Returns the features of the mean, shape (n, f), and where each block of them stands.

    Args:
        basis: of f_0.
        u: coordinates (theta, c), shape (n, p + q).
        psi: strengths, shape (n, K).
        bent: effects that have a square, shape (K,).
        crossed: two effects each that have a product.
        inputs: q.
        curved: effects that have a curve, and whether it is two-sided.
    """
    first, second = effect_columns(u)
    main = basis(u)
    widths = [main.shape[1] - basis.size, basis.size]
    parts = [main]
    for k in range(psi.shape[1]):
        strength = psi[:, k : k + 1]
        parts += [strength * first, bent[k] * strength**2 * second]
        widths += [first.shape[1], second.shape[1]]
    both = crossed_columns(u[:, u.shape[1] - inputs :])
    for k, other in crossed:
        parts.append(psi[:, k : k + 1] * psi[:, other : other + 1] * both)
        widths.append(both.shape[1])
    for k, is_two_sided in curved:
        parts.append(curved_columns(psi[:, k], u, is_two_sided))
        widths += [CURVES, curve_width(u.shape[1]) - CURVES]
    stops = np.cumsum(widths)
    blocks = [slice(int(b - w), int(b)) for b, w in zip(stops, widths, strict=True)]
    return np.concatenate(parts, axis=1), blocks


def curve_columns(strength: Array, is_two_sided: bool) -> Array:
    """Returns prior-scaled sines of a strength (n,), 0 at 0 and both ends, shape (n, `CURVES`)."""
    if is_two_sided:
        # Apart, for what has a threshold has a corner at 0.
        number = np.arange(1, CURVES // 2 + 1)
        sides = np.maximum(strength, 0.0), np.maximum(-strength, 0.0)
        sines = [np.sin(np.pi * np.multiply.outer(side, number)) / number for side in sides]
        return np.concatenate(sines, axis=-1)
    number = np.arange(1, CURVES + 1)
    return np.sin(np.pi * np.multiply.outer(strength, number)) / number


def curve_width(dimension: int) -> int:
    """Returns how many columns a curve has: its sines, and the first half times coordinates."""
    return CURVES + CURVES // 2 * dimension


def curved_columns(strength: Array, u: Array, is_two_sided: bool) -> Array:
    """Returns the columns of a curve that goes with u (n, d), at strengths (n,)."""
    sines = curve_columns(strength, is_two_sided)
    slopes = _slow(is_two_sided)
    along = sines[:, slopes, None] * (_SLOPE * (2 * u - 1))[:, None, :]
    return np.concatenate([sines, along.reshape(len(u), -1)], axis=1)


def fold_curve(columns: Array, u: Array, is_two_sided: bool) -> Array:
    """Returns what each sine multiplies at u (n, d), of what each column does.

    Args:
        columns: shape (`curve_width`, ...).
        u: coordinates.
        is_two_sided: whether the effect is.

    Returns:
        Shape (`CURVES`, n, ...).
    """
    plain, rest = columns[:CURVES], columns[CURVES:]
    found = np.repeat(plain[:, None], len(u), axis=1)
    each = rest.reshape(CURVES // 2, u.shape[1], *columns.shape[1:])
    found[_slow(is_two_sided)] += np.einsum("ni,ji...->jn...", _SLOPE * (2 * u - 1), each)
    return found


def _slow(is_two_sided: bool) -> list[int]:
    """Numbers of the sines that go with the coordinates, the slowest of each side."""
    half = CURVES // 2
    return [*range(half // 2), *range(half, half + half // 2)] if is_two_sided else [*range(half)]


def curved_effects(design: Design, psi: Array) -> tuple[tuple[int, bool], ...]:
    """Returns effects that many rows of psi (n, K) show, and whether they are two-sided."""
    many = np.count_nonzero(psi, axis=0) >= _CURVED_ROWS
    return tuple(
        (k, effect.is_two_sided)
        for k, effect in enumerate(design.effects)
        if many[k] and effect.held is None
    )


def crossed_columns(condition: Array) -> Array:
    """Returns prior-scaled monomials of what two effects do together, shape (n, 1 + q)."""
    return np.column_stack([np.full(len(condition), _CONSTANT), _SLOPE * (2 * condition - 1)])


def crossed_effects(psi: Array) -> tuple[tuple[int, int], ...]:
    """Returns which two effects at least `_CROSSED_ROWS` rows of psi (n, K) have both, in order."""
    both = (psi != 0).astype(np.float64)
    many = np.triu(both.T @ both, 1)
    return tuple((int(k), int(other)) for k, other in np.argwhere(many >= _CROSSED_ROWS))


def effect_columns(u: Array) -> tuple[Array, Array]:
    """Returns prior-scaled monomials of g_k and of h_k, shape (n, any) each."""
    centred = 2 * u - 1
    dimension = u.shape[1]
    scales = np.full((dimension + 1) * (dimension + 2) // 2, _CURVATURE)
    scales[0], scales[1 : dimension + 1] = _CONSTANT, _SLOPE
    first = polynomial(centred, 2) * scales
    return first, first[:, : dimension + 1] * _SLOPE


def scale_columns(basis: Basis, u: Array, psi: Array, bent: NDArray[np.bool_]) -> Array:
    """Returns the features of the logarithm of the scales, shape (n, f)."""
    # A held strength may lie beyond what was poured: the noise there is that of the nearer size.
    strength = np.where(bent, np.abs(psi), np.clip(psi, 0.0, 1.0))
    return np.concatenate([basis(u), strength], axis=1)


def noise_correlation(noise: Array, weights: Array) -> Array:
    """Second moment of whitened residuals, shrunk to its diagonal."""
    held = np.clip(noise, -_LARGEST_RESIDUAL, _LARGEST_RESIDUAL)
    moment = (held * weights[:, None]).T @ held / weights.sum()
    return (1 - _SHRINKAGE) * moment + _SHRINKAGE * np.diag(np.diag(moment))
