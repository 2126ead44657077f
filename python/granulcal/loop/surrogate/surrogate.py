r"""One emulator of all pours: statistics given parameters, condition and strengths of effects.

Statistics of one pile repeat each other. With the correlation C of what a quadratic leaves of the
standardised z, the axes $y = C^{-1/2} z$ have noise of unit size and no correlation, so that the
surrogate's errors on different axes are independent, and an axis that many statistics agree on is
as well known as it deserves. On the axes

$$ m(\theta, c, \psi) = f_0(\theta, c)
   + \sum_k \psi_k (J a_k + \tilde g_k)(\theta, c) + \psi_k^2 h_k(\theta, c), \qquad
   y = m + s(\theta, c, \psi) \epsilon, \quad \epsilon \sim (0, R) $$

$f_0$ is a quadratic and random features of a Matern kernel; $J a_k$ the part of an effect that is a
shift of theta (`shift.py`), $\tilde g_k$ a quadratic and $h_k$ a linear function, each with a prior
width learnt for every statistic and effect (`blocks.py`). log s is a
function of the same coordinates and of the strengths. What the archive leaves unknown about m is
the posterior of the coefficients, the same for all pours of a condition and correlated between
conditions; nothing about it averages away with more measured pours. What the features cannot follow
would pass for noise of a pour; it shows as left-out residuals that near rows share,

$$ \lambda_j = \overline{(e_i / s_i)(e_{i'} / s_{i'})} + \overline{h_{ii'}} $$

over pairs of near base rows i, i' (h: what the posterior's own covariance takes from the product of
two left-out residuals), and counts as error of the surrogate, $\lambda_j s_j^2$.

Reference:
    Kennedy and O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001.
    Smyth, Generalized linear models with varying dispersion, JRSS B 51, 1989 (log scales).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.emulator.basis import Basis, learn_length_scales, polynomial
from granulcal.bayessim.emulator.noise import fit_log_scale
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.design import Design
from granulcal.loop.surrogate.blocks import fit_blocks
from granulcal.loop.surrogate.shift import Shift
from granulcal.loop.surrogate.transform import Transform

if TYPE_CHECKING:
    from granulcal.loop.surrogate.observation import Observation

__all__ = ["Surrogate"]

Array = NDArray[np.float64]

_FEATURES = 96
_SCALE_FEATURES = 10
_SCALE_STRETCH = 2.0
# Prior standard deviations of constant, slopes and curvatures of an effect, before its own width.
_CONSTANT, _SLOPE, _CURVATURE = 1.0, 0.5, 0.25
# Share of the correlation that is replaced by none.
_SHRINKAGE = 0.03
# Whitened residuals are held within this many standard deviations where they make covariances.
_LARGEST_RESIDUAL = 6.0
# A statistic whose most common value has this share of the pours says nothing smooth.
_LARGEST_SHARE = 0.9
# Rows of the archive whose residuals are kept from R, to make replicates of.
_DONOR_SHARE = 0.35
_LEAST_ROWS = 60
# Pairs of near rows that show what the features cannot follow.
_LACK_ROWS, _NEIGHBOURS = 2000, 4


@dataclass(frozen=True)
class Surrogate:
    """Density of m statistics given p parameters, q condition inputs and K strengths.

    Attributes:
        design: names and kinds of all coordinates.
        names: statistics that are used, m of them.
        columns: their columns in the archive, shape (m,).
        dropped: statistics that are not used, with the reason.
        transforms: scale of each statistic.
        axes: C^-1/2, symmetric, shape (m, m).
        labels: names of all statistics of the archive, s of them.
        raw_spread: standard deviation of each of these over the base pours, own unit, shape (s,).
        raw_range: smallest and largest value of each, shape (2, s).
        basis: features of f_0 over (theta, c).
        shift: the part of each effect that is a shift of theta.
        coefficients: shape (m, d).
        roots: of the coefficients' posterior covariances, shape (m, d, d).
        scale_basis: features of the log scales over (theta, c).
        scale_coefficients: shape (m, e).
        correlation: R over the archive, nearly the identity, shape (m, m).
        lack: lambda, variance of what the features cannot follow over that of noise, shape (m,).
        white: whitened residual of each row under the fit to the others, shape (n, m).
        noise: the same, of the scale of the noise alone, shape (n, m).
        rows: (theta, c) of each row, shape (n, p + q).
        is_donor: rows whose residuals make replicates and no covariance, shape (n,).
        dof: rows less coefficients that they decided, mean over statistics.
        excluded: rows that were not finite.
    """

    design: Design
    names: tuple[str, ...]
    columns: NDArray[np.intp]
    dropped: dict[str, str]
    transforms: tuple[Transform, ...]
    axes: Array
    labels: tuple[str, ...]
    raw_spread: Array
    raw_range: Array
    basis: Basis
    shift: Shift
    coefficients: Array
    roots: Array
    scale_basis: Basis
    scale_coefficients: Array
    correlation: Array
    lack: Array
    white: Array
    noise: Array
    rows: Array
    is_donor: NDArray[np.bool_]
    dof: float
    excluded: int

    @classmethod
    def fit(
        cls,
        design: Design,
        theta: ArrayLike,
        condition: ArrayLike,
        psi: ArrayLike,
        x: ArrayLike,
        *,
        names: Sequence[str] | None = None,
        features: int = _FEATURES,
        seed: int = 0,
    ) -> "Surrogate":
        """Returns the emulator of an archive.

        Args:
            design: what was varied.
            theta: shape (n, p), unit coordinates.
            condition: shape (n, q), unit coordinates.
            psi: shape (n, K), 0 where an effect is off.
            x: statistics in their own units, shape (n, s).
            names: of the statistics, s of them.
            features: random frequencies of f_0.
            seed: seed of frequencies and of the choice of donors.

        Raises:
            TrainingDataError: shapes, coordinates outside the unit range, or too few pours.
        """
        theta_, condition_, psi_ = design.check(theta, condition, psi)
        x_ = np.asarray(x, dtype=np.float64)
        if x_.ndim != 2 or len(x_) != len(theta_):
            raise TrainingDataError(f"x must have shape ({len(theta_)}, s), got {x_.shape}")
        labels = tuple(names) if names is not None else tuple(f"x{i}" for i in range(x_.shape[1]))
        if len(labels) != x_.shape[1]:
            raise TrainingDataError(f"{x_.shape[1]} statistics need as many names, got {labels}")
        columns, dropped = _usable(x_, labels)
        kept = np.isfinite(x_[:, columns]).all(axis=1)
        theta_, condition_, psi_, x_ = theta_[kept], condition_[kept], psi_[kept], x_[kept]
        finite = np.where(np.isfinite(x_), x_, np.nan)
        base = ~np.any(psi_ != 0, axis=1)
        if base.sum() < _LEAST_ROWS:
            raise TrainingDataError(
                f"the archive needs at least {_LEAST_ROWS} usable pours without effects, "
                f"got {int(base.sum())}"
            )
        u = np.column_stack([theta_, condition_])
        quadratic = polynomial(2 * u[base] - 1, 2)
        transforms = tuple(Transform.choose(x_[base, j], quadratic) for j in columns)
        z = np.column_stack([t(x_[:, j]) for t, j in zip(transforms, columns, strict=True)])
        axes = _axes(z[base], quadratic)
        z = z @ axes
        spread = z[base].std(axis=0)
        lengths = learn_length_scales(
            u[base], z[base] / spread, features=min(features, 64), seed=seed
        )
        basis = Basis.draw(u, lengths, features=features, seed=seed, degree=2)
        scale_basis = Basis.draw(
            u, _SCALE_STRETCH * lengths, features=_SCALE_FEATURES, seed=seed + 1, degree=2
        )
        count, size = z.shape
        shift = _shift(design, basis, u, psi_, z, base)
        moved = np.zeros_like(z)
        for k in range(psi_.shape[1]):
            on = psi_[:, k] != 0
            moved[on] += psi_[on, k, None] * shift.move(u[on], k)
        z = z - moved
        bent = np.array([effect.held is None for effect in design.effects], dtype=bool)
        design_matrix, blocks = _features(basis, u, psi_, bent)
        scale_matrix = _scale_features(scale_basis, u, psi_, bent)
        coefficients = np.empty((size, design_matrix.shape[1]))
        roots = np.empty((size, design_matrix.shape[1], design_matrix.shape[1]))
        scale_coefficients = np.empty((size, scale_matrix.shape[1]))
        white, noise, scales = np.empty((3, count, size))
        dof = 0.0
        gram = design_matrix.T @ design_matrix
        ones = np.ones(count)
        for j in range(size):
            fit = fit_blocks(design_matrix, z[:, j], ones, blocks, gram)
            scale = np.exp(scale_matrix @ fit_log_scale(scale_matrix, fit.noise))
            weighted = design_matrix / scale[:, None]
            fit = fit_blocks(design_matrix, z[:, j], scale, blocks, weighted.T @ weighted)
            scale_coefficients[j] = fit_log_scale(scale_matrix, fit.noise)
            scale = np.exp(scale_matrix @ scale_coefficients[j])
            coefficients[j], roots[j] = fit.coefficients, fit.root
            white[:, j], noise[:, j] = fit.left_out / scale, fit.noise / scale
            scales[:, j] = scale
            dof += fit.dof / size
        noise /= np.sqrt(np.mean(np.clip(noise, -6, 6) ** 2, axis=0))
        is_donor = np.random.default_rng(seed).random(count) < _DONOR_SHARE
        return cls(
            design=design,
            names=tuple(labels[j] for j in columns),
            columns=columns,
            dropped=dropped,
            transforms=transforms,
            axes=axes,
            labels=labels,
            raw_spread=np.nanstd(finite[base], axis=0),
            raw_range=np.stack([np.nanmin(finite, axis=0), np.nanmax(finite, axis=0)]),
            basis=basis,
            shift=shift,
            coefficients=coefficients,
            roots=roots,
            scale_basis=scale_basis,
            scale_coefficients=scale_coefficients,
            correlation=_correlation(noise, np.ones(count)),
            lack=_lack(basis, u[base], design_matrix[base], roots, white[base], scales[base]),
            white=white,
            noise=noise,
            rows=u,
            is_donor=is_donor,
            dof=dof,
            excluded=int((~kept).sum()),
        )

    @property
    def size(self) -> int:
        """Number of statistics m."""
        return len(self.names)

    def standardise(self, x: ArrayLike) -> Array:
        """Returns y of statistics in the archive's units and columns, shape (n, s) to (n, m).

        Raises:
            ObservationError: another number of columns, or a value that is not finite.
        """
        values = np.asarray(x, dtype=np.float64)
        if values.ndim != 2 or values.shape[1] != len(self.raw_spread):
            raise ObservationError(
                f"pours must have shape (n, {len(self.raw_spread)}), got {values.shape}"
            )
        used = values[:, self.columns]
        if not np.isfinite(used).all():
            bad = self.names[int(np.nonzero(~np.isfinite(used).all(axis=0))[0][0])]
            raise ObservationError(f"statistic {bad} of an observed pour is not finite")
        return np.column_stack([t(used[:, j]) for j, t in enumerate(self.transforms)]) @ self.axes

    @property
    def from_axes(self) -> Array:
        """C^1/2: y times it is z, shape (m, m)."""
        return np.asarray(np.linalg.inv(self.axes), dtype=np.float64)

    def beyond(self, observations: Sequence["Observation"]) -> tuple[str, ...]:
        """Returns which observed statistics lie outside the range of all archive pours.

        A range is that of the pours, widened by half of itself; statistics that never vary in the
        archive count as well: a value of their own is a trace of what no pour had.
        """
        low, high = self.raw_range
        slack = 0.5 * (high - low) + 1e-9 * np.maximum(np.abs(low), np.abs(high))
        found = []
        for one in observations:
            mean = one.pours.mean(axis=0)
            for j in np.nonzero((mean < low - slack) | (mean > high + slack))[0]:
                found.append(
                    f"{self.labels[int(j)]} at {one.label}: {mean[j]:.4g}, "
                    f"archive {low[j]:.4g} to {high[j]:.4g}"
                )
        return tuple(found)

    def features(self, theta: Array, condition: Array, psi: Array) -> Array:
        """Returns the features at rows of (theta, condition, psi), shape (n, d)."""
        return _features(self.basis, np.column_stack([theta, condition]), psi, self._bent)[0]

    @property
    def _bent(self) -> NDArray[np.bool_]:
        """Effects whose square was learnt, shape (K,)."""
        return np.array([effect.held is None for effect in self.design.effects], dtype=bool)

    def effect_features(self, theta: Array, condition: Array, k: int) -> tuple[Array, Array]:
        """Returns features of psi_k and of psi_k^2 at rows of (theta, condition), each (n, d)."""
        u = np.column_stack([theta, condition])
        first, second = _effect_columns(u)
        width, step = self.basis(u[:1]).shape[1], first.shape[1] + second.shape[1]
        start = width + k * step
        linear, square = np.zeros((2, len(u), self.coefficients.shape[1]))
        linear[:, start : start + first.shape[1]] = first
        if self._bent[k]:
            square[:, start + first.shape[1] : start + step] = second
        return linear, square

    def effect_move(self, theta: Array, condition: Array, k: int) -> Array:
        """Returns the shift of theta that psi_k multiplies, at rows of (theta, c), (n, m)."""
        return self.shift.move(np.column_stack([theta, condition]), k)

    def mean(self, theta: Array, condition: Array, psi: Array) -> Array:
        """Returns m at rows of (theta, condition, psi), axes, shape (n, m)."""
        u = np.column_stack([theta, condition])
        main = self.basis(u)
        width = main.shape[1]
        total = main @ self.coefficients[:, :width].T
        active = np.nonzero(psi.any(axis=0))[0]
        if len(active) == 0:
            return total
        first, second = _effect_columns(u)
        step = first.shape[1] + second.shape[1]
        for k in active:
            strength, start = psi[:, k : k + 1], width + k * step
            bend = strength**2 if self._bent[k] else 0.0 * strength
            columns = np.concatenate([strength * first, bend * second], axis=1)
            total += columns @ self.coefficients[:, start : start + step].T
            total += strength * self.shift.move(u, int(k))
        return total

    def scale(self, theta: Array, condition: Array, psi: Array) -> Array:
        """Returns s at rows of (theta, condition, psi), shape (n, m)."""
        u = np.column_stack([theta, condition])
        features = _scale_features(self.scale_basis, u, psi, self._bent)
        return np.exp(features @ self.scale_coefficients.T)

    def weights_near(self, theta: Array, condition: Array, width: float) -> Array:
        """Returns how near each archive row is to a point, in (0, 1], shape (n,)."""
        at = np.concatenate([theta, condition])
        return np.exp(-0.5 * np.sum(((self.rows - at) / width) ** 2, axis=1))

    def correlation_near(self, theta: Array, condition: Array, width: float) -> Array:
        """Returns R of rows near a point, blended with that of the archive, shape (m, m).

        The local share is n_e / (n_e + 4 m), n_e the effective number of near rows; donors are
        left out, so that replicates made of them are no draws of what made the covariance.
        """
        near = self.weights_near(theta, condition, width) * ~self.is_donor
        effective = near.sum() ** 2 / max(float(near @ near), 1e-300)
        share = effective / (effective + 4 * self.size)
        local = _correlation(self.noise, near + 1e-12)
        return share * local + (1 - share) * self.correlation


def _shift(
    design: Design,
    basis: Basis,
    u: Array,
    psi: Array,
    z: Array,
    base: NDArray[np.bool_],
) -> Shift:
    """Shifts of theta, from slopes that pours without effects have."""
    plain = basis(u[base])
    waves = 2 * len(basis.frequencies)
    blocks = [slice(0, plain.shape[1] - waves), slice(plain.shape[1] - waves, plain.shape[1])]
    gram, ones = plain.T @ plain, np.ones(len(plain))
    fits = [fit_blocks(plain, z[base, j], ones, blocks, gram) for j in range(z.shape[1])]
    coefficients = np.array([fit.coefficients for fit in fits])
    sizes = np.array([np.sqrt(np.mean(_held(fit.noise) ** 2)) for fit in fits])
    p = len(design.parameters)
    return Shift.fit(basis, coefficients, sizes, u[~base], psi[~base], z[~base], p)


def _held(noise: Array) -> Array:
    """Residuals cut where they are no noise any more."""
    largest = _LARGEST_RESIDUAL * float(np.median(np.abs(noise)) / 0.6745)
    return np.clip(noise, -largest, largest)


def _lack(
    basis: Basis, u: Array, features: Array, roots: Array, white: Array, scales: Array
) -> Array:
    """Lambda of each axis; pairs are each of up to `_LACK_ROWS` rows with its nearest."""
    metric = np.sqrt(np.mean(basis.frequencies**2, axis=0)) / basis.scale
    v = u * metric
    chosen = np.random.default_rng(0).permutation(len(u))[:_LACK_ROWS]
    gaps = np.sum(v[chosen] ** 2, axis=1)[:, None] + np.sum(v**2, axis=1) - 2 * v[chosen] @ v.T
    gaps[np.arange(len(chosen)), chosen] = np.inf
    near = np.argpartition(gaps, _NEIGHBOURS, axis=1)[:, :_NEIGHBOURS]
    held = np.clip(white, -_LARGEST_RESIDUAL, _LARGEST_RESIDUAL)
    products = np.mean(held[chosen][:, None] * held[near], axis=(0, 1))
    shared = np.empty(len(products))
    for j, root in enumerate(roots):
        along = (features @ root) / scales[:, j : j + 1]
        shared[j] = np.mean(np.einsum("ij,ikj->ik", along[chosen], along[near], optimize=True))
    return np.maximum(products + shared, 0.0)


def _axes(z: Array, quadratic: Array) -> Array:
    """C^-1/2 of what a quadratic leaves, C shrunk a little to its diagonal."""
    hat = np.linalg.qr(quadratic)[0]
    left = z - hat @ (hat.T @ z)
    held = np.clip(left / left.std(axis=0), -_LARGEST_RESIDUAL, _LARGEST_RESIDUAL)
    moment = (held * left.std(axis=0)).T @ (held * left.std(axis=0)) / len(z)
    moment = (1 - _SHRINKAGE) * moment + _SHRINKAGE * np.diag(np.diag(moment))
    values, vectors = np.linalg.eigh(moment)
    return (vectors / np.sqrt(values)) @ vectors.T


def _usable(x: Array, labels: tuple[str, ...]) -> tuple[NDArray[np.intp], dict[str, str]]:
    """Columns that can be emulated, and why the others cannot."""
    dropped: dict[str, str] = {}
    for j, label in enumerate(labels):
        finite = x[np.isfinite(x[:, j]), j]
        if len(finite) < 0.95 * len(x):
            dropped[label] = f"not finite in {len(x) - len(finite)} of {len(x)} pours"
        elif finite.std() <= 1e-9 * max(float(np.abs(finite).max()), 1e-300):
            dropped[label] = "constant"
        elif np.unique(finite, return_counts=True)[1].max() > _LARGEST_SHARE * len(finite):
            dropped[label] = "one value in more than nine of ten pours"
    kept = [j for j, label in enumerate(labels) if label not in dropped]
    if not kept:
        raise TrainingDataError("no statistic varies over the archive")
    return np.array(kept, dtype=np.intp), dropped


def _features(
    basis: Basis, u: Array, psi: Array, bent: NDArray[np.bool_]
) -> tuple[Array, list[slice]]:
    first, second = _effect_columns(u)
    main = basis(u)
    waves = 2 * len(basis.frequencies)
    widths = [main.shape[1] - waves, waves]
    parts = [main]
    for k in range(psi.shape[1]):
        strength = psi[:, k : k + 1]
        parts += [strength * first, bent[k] * strength**2 * second]
        widths += [first.shape[1], second.shape[1]]
    stops = np.cumsum(widths)
    blocks = [slice(int(b - w), int(b)) for b, w in zip(stops, widths, strict=True)]
    return np.concatenate(parts, axis=1), blocks


def _effect_columns(u: Array) -> tuple[Array, Array]:
    """Prior-scaled monomials of g_k and of h_k."""
    centred = 2 * u - 1
    dimension = u.shape[1]
    scales = np.full((dimension + 1) * (dimension + 2) // 2, _CURVATURE)
    scales[0], scales[1 : dimension + 1] = _CONSTANT, _SLOPE
    first = polynomial(centred, 2) * scales
    return first, first[:, : dimension + 1] * _SLOPE


def _scale_features(basis: Basis, u: Array, psi: Array, bent: NDArray[np.bool_]) -> Array:
    # A held strength may lie beyond what was poured: the noise there is that of the nearer size.
    strength = np.where(bent, np.abs(psi), np.clip(psi, 0.0, 1.0))
    return np.concatenate([basis(u), strength], axis=1)


def _correlation(noise: Array, weights: Array) -> Array:
    """Second moment of whitened residuals, shrunk to its diagonal."""
    held = np.clip(noise, -_LARGEST_RESIDUAL, _LARGEST_RESIDUAL)
    moment = (held * weights[:, None]).T @ held / weights.sum()
    return (1 - _SHRINKAGE) * moment + _SHRINKAGE * np.diag(np.diag(moment))
