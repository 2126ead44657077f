r"""One emulator of all pours: statistics given parameters, condition and strengths of effects.

Statistics of one pile repeat each other. With the correlation C of what a quadratic leaves of the
standardised z, the axes $y = C^{-1/2} z$ have noise of unit size and no correlation, so that the
surrogate's errors on different axes are independent, and an axis that many statistics agree on is
as well known as it deserves. On the axes

$$ m(\theta, c, \psi) = f_0(\theta, c)
   + \sum_k \psi_k (J a_k + \tilde g_k)(\theta, c) + \psi_k^2 h_k(\theta, c)
   + \sum_{k < l} \psi_k \psi_l q_{kl}(c) + \sum_k r_k(\psi_k, \theta, c), \qquad
   y = m + s(\theta, c, \psi) \epsilon, \quad \epsilon \sim (0, R) $$

$f_0$ is a quadratic and the leading eigenfunctions of a Matern kernel (`leading.py`); $J a_k$ the
part of an effect that is a shift of theta (`shift.py`), $\tilde g_k$ a quadratic and $h_k$ a linear
function, each with a prior width learnt for every statistic and effect (`blocks.py`). $q_{kl}$,
linear in c, is what two effects do together, learnt of those that the archive has poured or read
together. $r_k$, a sum of sines, the slower ones linear in the coordinates, is the curve of an
effect that many pours show, as those of the image are: a blur of a small $\sigma$ takes no pixel
across the threshold and a larger one at once all along an edge, which no parabola follows, and
how much edge there is goes with the coordinates. log s is a function of the same coordinates and
of the strengths. A pour that is read under several effects is several rows, which share its noise
(`readings.py`). What the archive leaves unknown about m is the posterior of the coefficients, the
same for all pours of a condition and correlated between conditions; nothing about it averages away
with more measured pours. What the features cannot follow would pass for noise of a pour; it shows
as left-out residuals that near rows share,

$$ \lambda_j = \overline{(e_i / s_i)(e_{i'} / s_{i'})} + \overline{h_{ii'}} $$

over pairs of near base rows i, i' (h: what the posterior's own covariance takes from the product of
two left-out residuals), and counts as error of the surrogate, $\lambda_j s_j^2$.

Reference:
    Kennedy and O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001.
    Smyth, Generalized linear models with varying dispersion, JRSS B 51, 1989 (log scales).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.emulator.basis import Basis, learn_length_scales, polynomial
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.design import Design
from granulcal.loop.surrogate.anchor import Anchor
from granulcal.loop.surrogate.axis_fits import AxisFits
from granulcal.loop.surrogate.blocks import fit_blocks
from granulcal.loop.surrogate.bordered import Features
from granulcal.loop.surrogate.bordering import Bordering
from granulcal.loop.surrogate.columns import (
    crossed_columns,
    crossed_effects,
    curve_width,
    curved_columns,
    curved_effects,
    effect_columns,
    held_residuals,
    lack_of_fit,
    mean_columns,
    noise_correlation,
    scale_columns,
    uncorrelated_axes,
)
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.leading import LeadingBasis
from granulcal.loop.surrogate.readings import Readings
from granulcal.loop.surrogate.roots import Roots
from granulcal.loop.surrogate.shift import Shift
from granulcal.loop.surrogate.transform import Transform
from granulcal.loop.surrogate.usable import spread_of, usable_statistics

__all__ = ["DONOR_SHARE", "Surrogate"]

Array = NDArray[np.float64]

_FEATURES = 192
_LENGTH_FREQUENCIES = 64
_SCALE_FEATURES = 10
_SCALE_STRETCH = 2.0
_LEAST_ROWS = 60

DONOR_SHARE = 0.35
"""Rows whose residuals are kept from R, to make replicates of."""


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
        raw_spread: standard deviation of each of these over the base pours, or over all where it is
            constant there, infinite where it is in all; own unit, shape (s,).
        raw_range: smallest and largest value of each, shape (2, s).
        basis: features of f_0 over (theta, c).
        shift: the part of each effect that is a shift of theta.
        coefficients: shape (m, d).
        roots: of the coefficients' posterior covariances.
        scale_basis: features of the log scales over (theta, c).
        scale_coefficients: shape (m, e).
        correlation: R over the archive, nearly the identity, shape (m, m).
        lack: lambda, variance of what the features cannot follow over that of noise, shape (m,).
        white: whitened residual of each row under the fit to the others, shape (n, m).
        noise: the same, of the scale of the noise alone, shape (n, m).
        rows: (theta, c) of each row, shape (n, p + q).
        is_donor: rows whose residuals make replicates and no covariance, shape (n,).
        shares: one over the readings of each row's pour, shape (n,).
        dof: pours less coefficients that they decided, mean over statistics.
        excluded: rows that were not finite.
        crossed: two effects each that have a q_kl.
        curved: effects that have an r_k, and whether it is two-sided.
        anchor: what true pours at fits have shown; None before any.
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
    basis: LeadingBasis
    shift: Shift
    coefficients: Array
    roots: Roots
    scale_basis: Basis
    scale_coefficients: Array
    correlation: Array
    lack: Array
    white: Array
    noise: Array
    rows: Array
    is_donor: NDArray[np.bool_]
    shares: Array
    dof: float
    excluded: int
    crossed: tuple[tuple[int, int], ...] = ()
    curved: tuple[tuple[int, bool], ...] = ()
    anchor: Anchor | None = None

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
        pour: ArrayLike | None = None,
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
            pour: number of the pour that each row is a reading of, shape (n,); None: each of its
                own.
            features: largest number of the kernel's eigenfunctions in f_0.
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
        columns, dropped = usable_statistics(x_, labels, np.all(psi_ == 0, axis=1))
        kept = np.isfinite(x_[:, columns]).all(axis=1)
        number = np.arange(len(x_)) if pour is None else np.asarray(pour)
        if number.shape != (len(x_),):
            raise TrainingDataError(f"pour must have shape ({len(x_)},), got {number.shape}")
        readings = Readings.of(number[kept])
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
        active = psi_[:, psi_.any(axis=0)]
        everywhere = np.column_stack([polynomial(2 * u - 1, 2), active, active**2])
        transforms = tuple(
            Transform.choose(x_[base, j], quadratic, (x_[:, j], everywhere)) for j in columns
        )
        z = np.column_stack([t(x_[:, j]) for t, j in zip(transforms, columns, strict=True)])
        axes = uncorrelated_axes(z[base], quadratic)
        z = z @ axes
        spread = z[base].std(axis=0)
        lengths = learn_length_scales(
            u[base], z[base] / spread, features=_LENGTH_FREQUENCIES, seed=seed
        )
        basis = LeadingBasis.draw(u, lengths, most=features, seed=seed)
        scale_basis = Basis.draw(
            u, _SCALE_STRETCH * lengths, features=_SCALE_FEATURES, seed=seed + 1, degree=2
        )
        shift = _shift(design, basis, u, psi_, z, base)
        moved = np.zeros_like(z)
        for k in range(psi_.shape[1]):
            on = psi_[:, k] != 0
            moved[on] += psi_[on, k, None] * shift.move(u[on], k)
        z = z - moved
        crossed, curved = crossed_effects(psi_), curved_effects(design, psi_)
        inputs = condition_.shape[1]
        of_mean, blocks = mean_columns(basis, u, psi_, design.bends, crossed, inputs, curved)
        bordered = Features.of(Bordering.of(of_mean, blocks, readings), of_mean)
        of_mean = of_mean[base]
        of_scale = scale_columns(scale_basis, u, psi_, design.bends)
        fits = AxisFits.of(bordered, blocks, of_scale, z, readings)
        # All readings of a pour or none: another's residual is nearly its own.
        lends = np.random.default_rng(seed).random(len(readings.counts)) < DONOR_SHARE
        return cls(
            design=design,
            names=tuple(labels[j] for j in columns),
            columns=columns,
            dropped=dropped,
            transforms=transforms,
            axes=axes,
            labels=labels,
            raw_spread=spread_of(finite, base),
            raw_range=np.stack([np.nanmin(finite, axis=0), np.nanmax(finite, axis=0)]),
            basis=basis,
            shift=shift,
            coefficients=fits.coefficients,
            roots=fits.roots,
            scale_basis=scale_basis,
            scale_coefficients=fits.scale_coefficients,
            correlation=noise_correlation(fits.noise, readings.shares),
            lack=lack_of_fit(
                basis, u[base], of_mean, fits.roots, fits.white[base], fits.scales[base]
            ),
            white=fits.white,
            noise=fits.noise,
            rows=u,
            is_donor=lends[readings.pour],
            shares=readings.shares,
            dof=fits.dof,
            excluded=int((~kept).sum()),
            crossed=crossed,
            curved=curved,
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

    def moved(self, x: Array, by: Array) -> Array:
        """Returns statistics `x` (n, s) in the archive's units moved `by` (m,) on the axes of y."""
        rows = np.array(x, dtype=np.float64)
        z = by @ self.from_axes
        for j, (column, transform) in enumerate(zip(self.columns, self.transforms, strict=True)):
            rows[:, column] = transform.inverse(transform(rows[:, column]) + z[j])
        return rows

    @property
    def from_axes(self) -> Array:
        """C^1/2: y times it is z, shape (m, m)."""
        return np.asarray(np.linalg.inv(self.axes), dtype=np.float64)

    def beyond(self, observations: Sequence[ConditionPours]) -> tuple[str, ...]:
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
        u, inputs = np.column_stack([theta, condition]), condition.shape[1]
        of = self.design.bends, self.crossed, inputs, self.curved
        return mean_columns(self.basis, u, psi, *of)[0]

    def effect_features(self, theta: Array, condition: Array, k: int) -> tuple[Array, Array]:
        """Returns features of psi_k and of psi_k^2 at rows of (theta, condition), each (n, d)."""
        u = np.column_stack([theta, condition])
        first, second = effect_columns(u)
        width, step = self.basis(u[:1]).shape[1], first.shape[1] + second.shape[1]
        start = width + k * step
        linear, square = np.zeros((2, len(u), self.coefficients.shape[1]))
        linear[:, start : start + first.shape[1]] = first
        if self.design.bends[k]:
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
        if self.anchor is not None:
            total += self.anchor.at(theta, condition, psi)
        active = np.nonzero(psi.any(axis=0))[0]
        if len(active) == 0:
            return total
        first, second = effect_columns(u)
        step = first.shape[1] + second.shape[1]
        for k in active:
            strength, start = psi[:, k : k + 1], width + k * step
            bend = strength**2 if self.design.bends[k] else 0.0 * strength
            columns = np.concatenate([strength * first, bend * second], axis=1)
            total += columns @ self.coefficients[:, start : start + step].T
            curve = self.coefficients[:, self.curve(int(k))]
            total += self.curve_features(psi[:, k], u, int(k)) @ curve.T
        total += self.shift.along(u, psi)
        for k, other in self.crossed_of(psi):
            strength = psi[:, k : k + 1] * psi[:, other : other + 1]
            learnt = self.coefficients[:, self.crossed_slice(k, other)]
            total += strength * (crossed_columns(condition) @ learnt.T)
        return total

    def crossed_of(self, psi: Array) -> list[tuple[int, int]]:
        """Returns which two effects of rows of psi (n, K) have a q_kl."""
        active = np.nonzero(psi.any(axis=0))[0].tolist()
        return [pair for pair in combinations(active, 2) if pair in self.crossed]

    def crossed_slice(self, k: int, other: int) -> slice:
        """Returns the columns of q_kl among the features."""
        width = 1 + len(self.design.conditions)
        start = self.coefficients.shape[1] - self._curve_width * len(self.curved)
        start -= width * len(self.crossed)
        start += width * self.crossed.index((k, other))
        return slice(start, start + width)

    def curve(self, k: int) -> slice:
        """Returns the columns of r_k among the features; none if effect k has no curve."""
        stop = self.coefficients.shape[1]
        for other, _ in reversed(self.curved):
            if other == k:
                return slice(stop - self._curve_width, stop)
            stop -= self._curve_width
        return slice(0, 0)

    @property
    def _curve_width(self) -> int:
        """Columns of one r_k."""
        return curve_width(len(self.design.parameters) + len(self.design.conditions))

    def curve_features(self, strength: Array, u: Array, k: int) -> Array:
        """Returns the features of r_k at strengths (n,) and (theta, c) (n, p + q), (n, f).

        f is 0 without a curve.
        """
        kinds = dict(self.curved)
        if k not in kinds:
            return np.empty((len(u), 0))
        return curved_columns(strength, u, kinds[k])

    def scale(self, theta: Array, condition: Array, psi: Array) -> Array:
        """Returns s at rows of (theta, condition, psi), shape (n, m)."""
        u = np.column_stack([theta, condition])
        features = scale_columns(self.scale_basis, u, psi, self.design.bends)
        return np.exp(features @ self.scale_coefficients.T)

    def weights_near(self, theta: Array, condition: Array, width: float) -> Array:
        """Returns how near each archive row is to a point, in (0, 1], shape (n,).

        The readings of a pour count as one pour together.
        """
        at = np.concatenate([theta, condition])
        return self.shares * np.exp(-0.5 * np.sum(((self.rows - at) / width) ** 2, axis=1))

    def correlation_near(self, theta: Array, condition: Array, width: float) -> Array:
        """Returns R of rows near a point, blended with that of the archive, shape (m, m).

        The local share is n_e / (n_e + 4 m), n_e the effective number of near rows; donors are
        left out, so that replicates made of them are no draws of what made the covariance.
        """
        near = self.weights_near(theta, condition, width) * ~self.is_donor
        effective = near.sum() ** 2 / max(float(near @ (near / self.shares)), 1e-300)
        share = effective / (effective + 4 * self.size)
        local = noise_correlation(self.noise, near + 1e-12)
        return share * local + (1 - share) * self.correlation


def _shift(
    design: Design,
    basis: LeadingBasis,
    u: Array,
    psi: Array,
    z: Array,
    base: NDArray[np.bool_],
) -> Shift:
    """Shifts of theta, from slopes that pours without effects have."""
    plain = basis(u[base])
    start = plain.shape[1] - basis.size
    blocks = [slice(0, start), slice(start, plain.shape[1])]
    gram, ones = plain.T @ plain, np.ones(len(plain))
    fits = [fit_blocks(plain, z[base, j], ones, blocks, gram) for j in range(z.shape[1])]
    coefficients = np.array([fit.coefficients for fit in fits])
    sizes = np.array([np.sqrt(np.mean(held_residuals(fit.noise) ** 2)) for fit in fits])
    p = len(design.parameters)
    return Shift.fit(basis, coefficients, sizes, u[~base], psi[~base], z[~base], p)
