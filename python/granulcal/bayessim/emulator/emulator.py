r"""Emulator: the density of statistics given parameters, learnt from pairs.

Given the coordinates u of the parameters a vector y of statistics is

$$ y_j = m_j(u) + s_j(u) \epsilon_j, \qquad \epsilon \sim t_\nu(0, R) $$

with means and log scales linear in random features of u. What the pairs leave unknown about the
means is kept as a scale of its own, $s_j(u) \sqrt{h_j(u)}$, which many observations of one u share
and therefore do not average away.

Reference:
    Wood, Statistical inference for noisy nonlinear ecological dynamic systems, Nature 466, 2010
    (normal statistics of simulated parameters: synthetic likelihood).
    Kennedy and O'Hagan, Bayesian calibration of computer models, JRSS B 63, 2001.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.basis import Basis
from granulcal.bayessim.emulator.noise import Noise, fit_log_scale
from granulcal.bayessim.emulator.ridge import Ridge, RidgeFit, weighted_ridge

__all__ = ["Emulator", "Prediction"]

Array = NDArray[np.float64]

_SCALE_FEATURES = 16
# Scales change more slowly over the parameters than means do.
_SCALE_STRETCH = 2.0
# Points at which the uncertainty of the means is tabulated before it is fitted.
_UNCERTAINTY_POINTS = 1500
# An axis of statistics that hang together exactly has no more spread than this, which is round-off.
_ROUND_OFF = 1e-9
# Points whose features are held at once: so many stay in the processor's cache.
_BLOCK = 512


@dataclass(frozen=True)
class Prediction:
    """What the emulator expects at n points.

    Attributes:
        means: shape (n, s).
        scales: standard deviation of one observation, shape (n, s).
        unknown: standard deviation of the means themselves, shape (n, s).
    """

    means: Array
    scales: Array
    unknown: Array

    def first(self, count: int) -> "Prediction":
        """Returns what is expected of the first `count` statistics."""
        return Prediction(self.means[:, :count], self.scales[:, :count], self.unknown[:, :count])


@dataclass(frozen=True)
class Emulator:
    """Density of s statistics given p coordinates.

    Attributes:
        basis: features of the means.
        coefficients: of the means, shape (s, d).
        scale_basis: features of the log scales.
        scale_coefficients: of the log scale of one observation, shape (s, e).
        unknown_coefficients: of the log scale of the means, shape (s, e).
        noise: correlation and tails.
        shift: mean of the training statistics, shape (s,).
        spread: standard deviation of the training statistics, shape (s,).
    """

    basis: Basis
    coefficients: Array
    scale_basis: Basis
    scale_coefficients: Array
    unknown_coefficients: Array
    noise: Noise
    shift: Array
    spread: Array

    @classmethod
    def fit(
        cls,
        u: Array,
        y: Array,
        length_scales: Array,
        *,
        features: int,
        varying_scale: bool,
        seed: int = 0,
    ) -> tuple["Emulator", Array]:
        """Returns the emulator of pairs and what it leaves of them.

        Args:
            u: coordinates of the parameters, shape (n, p).
            y: statistics, in a form that noise around a mean can have, shape (n, s).
            length_scales: of `learn_length_scales`, shape (p,).
            features: random frequencies of each basis.
            varying_scale: whether the scale of the noise may change over the parameters.
            seed: seed of the frequencies.

        Returns:
            The emulator, and the residuals of each pair under a fit to the other pairs over the
            scale of the noise, shape (n, s).
        """
        shift, spread = y.mean(axis=0), y.std(axis=0)
        spread = np.where(spread > _ROUND_OFF, spread, 1.0)
        z = (y - shift) / spread
        count, statistics = z.shape
        basis = Basis.draw(u, length_scales, features=features, seed=seed)
        design = basis(u)
        equal = Ridge(design)
        scale_basis = Basis.draw(
            u, _SCALE_STRETCH * length_scales, features=_SCALE_FEATURES, seed=seed + 1, degree=2
        )
        scale_design = scale_basis(u)
        points = _spread_points(u, _UNCERTAINTY_POINTS)
        point_design = basis(points)
        point_scale_design = scale_basis(points)
        scale_coefficients = np.zeros((statistics, scale_design.shape[1]))
        unknown_coefficients = np.zeros_like(scale_coefficients)
        coefficients = np.zeros((statistics, design.shape[1]))
        white = np.zeros_like(z)
        smooth = Ridge(point_scale_design)
        for j in range(statistics):
            fit, weights = equal.fit(z[:, j]), np.ones(count)
            noise = _noise(fit, z[:, j])
            log_scale_coefficients = fit_log_scale(scale_design, noise, constant=not varying_scale)
            if varying_scale:
                # Scales given means, then means given scales, then scales again.
                log_scale = scale_design @ log_scale_coefficients
                weights = np.exp(-2 * (log_scale - log_scale.mean()))
                weights /= weights.mean()
                fit = weighted_ridge(design, weights, z[:, j], fit.ratio)
                noise = _noise(fit, z[:, j])
                log_scale_coefficients = fit_log_scale(scale_design, noise)
            scale = np.exp(scale_design @ log_scale_coefficients)
            # The ridge's own unit of variance: that of a pair of weight 1.
            unit = float(np.exp(np.mean(np.log(scale**2 * weights))))
            unknown = np.sqrt(unit * np.sum((point_design @ fit.root) ** 2, axis=1))
            coefficients[j] = fit.coefficients
            scale_coefficients[j] = log_scale_coefficients
            unknown_coefficients[j] = smooth.fit(np.log(np.maximum(unknown, 1e-9))).coefficients
            white[:, j] = noise / scale
        emulator = cls(
            basis=basis,
            coefficients=coefficients,
            scale_basis=scale_basis,
            scale_coefficients=scale_coefficients,
            unknown_coefficients=unknown_coefficients,
            noise=Noise.fit(white),
            shift=shift,
            spread=spread,
        )
        return emulator, white

    def first(self, count: int, noise: Noise) -> "Emulator":
        """Returns the emulator of the first `count` statistics, with a noise of their own."""
        rows = slice(0, count)
        return replace(
            self,
            coefficients=self.coefficients[rows],
            scale_coefficients=self.scale_coefficients[rows],
            unknown_coefficients=self.unknown_coefficients[rows],
            noise=noise,
            shift=self.shift[rows],
            spread=self.spread[rows],
        )

    def predict(self, u: Array) -> Prediction:
        """Returns what is expected at `u` (n, p)."""
        means = np.empty((len(u), len(self.coefficients)))
        for start in range(0, len(u), _BLOCK):
            rows = slice(start, start + _BLOCK)
            means[rows] = self.basis(u[rows]) @ self.coefficients.T
        design = self.scale_basis(u)
        scales = np.exp(design @ self.scale_coefficients.T)
        unknown = np.exp(design @ self.unknown_coefficients.T)
        return Prediction(
            self.shift + self.spread * means, self.spread * scales, self.spread * unknown
        )

    def simulate(self, u: Array, generator: np.random.Generator, *, widening: float = 1.0) -> Array:
        """Returns one observation at each row of `u` (n, p), the means' uncertainty included."""
        prediction = self.predict(u)
        total = widening * np.hypot(prediction.scales, prediction.unknown)
        return prediction.means + total * self.noise.sample(len(u), generator)


def _noise(fit: RidgeFit, z: Array) -> Array:
    """Residuals; those from the others are wider than the noise by the others' uncertainty."""
    return fit.loo_residuals(z) * np.sqrt(1 - fit.leverage)


def _spread_points(u: Array, count: int) -> Array:
    """Training points and points between pairs of them: where the emulator will be asked."""
    generator = np.random.default_rng(0)
    first, second = generator.integers(len(u), size=(2, count))
    share = generator.random((count, 1))
    mixed = share * u[first] + (1 - share) * u[second]
    mixed[: count // 2] = u[first[: count // 2]]
    return mixed
