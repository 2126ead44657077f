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

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.basis import Basis, learn_length_scales
from granulcal.bayessim.noise import Noise, fit_log_scale
from granulcal.bayessim.ridge import Ridge

__all__ = ["Emulator", "Leftover", "Prediction"]

Array = NDArray[np.float64]

# Features of the means at half, once and twice the learnt length scales; the evidence chooses.
_MULTIPLES = (0.5, 1.0, 2.0)
_SCALE_FEATURES = 16
# Scales change more slowly over the parameters than means do.
_SCALE_STRETCH = 2.0
# Rounds of means given scales, scales given means.
_ROUNDS = 2
# Points at which the uncertainty of the means is tabulated before it is fitted.
_UNCERTAINTY_POINTS = 1500


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


@dataclass(frozen=True)
class Leftover:
    """What the fit leaves of its own pairs, each pair predicted from the others.

    Attributes:
        residuals: shape (n, s).
        standardised: residuals over their predicted standard deviations, shape (n, s).
        influence: for statistic j, pair i: the change of the coefficients of j when pair i is left
            out, shape (s, n, d).
    """

    residuals: Array
    standardised: Array
    influence: Array


@dataclass(frozen=True)
class Emulator:
    """Density of s statistics given p coordinates.

    Attributes:
        bases: features of the means, one for each multiple of the length scales.
        base: which of `bases` a statistic uses, shape (s,).
        coefficients: of the means, shape (s, d).
        scale_basis: features of the log scales.
        scale_coefficients: of the log scale of one observation, shape (s, e).
        unknown_coefficients: of the log scale of the means, shape (s, e).
        noise: correlation and tails.
        shift: mean of the training statistics, shape (s,).
        spread: standard deviation of the training statistics, shape (s,).
    """

    bases: tuple[Basis, ...]
    base: NDArray[np.intp]
    coefficients: Array
    scale_basis: Basis
    scale_coefficients: Array
    unknown_coefficients: Array
    noise: Noise
    shift: Array
    spread: Array
    leftover: Leftover | None = field(default=None, compare=False)

    @classmethod
    def fit(
        cls, u: Array, y: Array, *, features: int = 64, varying_scale: bool = True, seed: int = 0
    ) -> "Emulator":
        """Returns the emulator of pairs `u` (n, p), `y` (n, s).

        Args:
            u: coordinates of the parameters.
            y: statistics, already brought to a shape that noise around a mean can have.
            features: random frequencies of each basis.
            varying_scale: whether the scale of the noise may change over the parameters.
            seed: seed of the frequencies.
        """
        shift, spread = y.mean(axis=0), y.std(axis=0)
        spread = np.where(spread > 0, spread, 1.0)
        z = (y - shift) / spread
        count, statistics = z.shape
        base_length = learn_length_scales(u, z, features=features, seed=seed)
        bases = tuple(
            Basis.draw(u, base_length * multiple, features=features, seed=seed)
            for multiple in _MULTIPLES
        )
        designs = [basis(u) for basis in bases]
        ridges = [Ridge(design) for design in designs]
        evidence = np.array([[r.fit(z[:, j]).log_evidence for r in ridges] for j in range(statistics)])
        base = evidence.argmax(axis=1)
        scale_basis = Basis.draw(
            u, _SCALE_STRETCH * base_length, features=_SCALE_FEATURES, seed=seed + 1, degree=2
        )
        scale_design = scale_basis(u)
        points = _spread_points(u, _UNCERTAINTY_POINTS)
        point_designs = [basis(points) for basis in bases]
        point_scale_design = scale_basis(points)
        scale_coefficients = np.zeros((statistics, scale_design.shape[1]))
        unknown_coefficients = np.zeros_like(scale_coefficients)
        coefficients = np.zeros((statistics, designs[0].shape[1]))
        residuals, white = np.zeros_like(z), np.zeros_like(z)
        influence = np.zeros((statistics, count, designs[0].shape[1]))
        smooth = Ridge(point_scale_design)
        for j in range(statistics):
            design = designs[base[j]]
            ridge, weights = ridges[base[j]], np.ones(count)
            for round_number in range(_ROUNDS if varying_scale else 1):
                fit = ridge.fit(z[:, j])
                left = fit.loo_residuals(z[:, j])
                # A residual from the others is wider than the noise by the others' uncertainty.
                noise = left * np.sqrt(1 - fit.leverage)
                log_scale_coefficients = fit_log_scale(
                    scale_design, noise, constant=not varying_scale
                )
                if varying_scale and round_number + 1 < _ROUNDS:
                    log_scale = scale_design @ log_scale_coefficients
                    weights = np.exp(-2 * (log_scale - log_scale.mean()))
                    weights /= weights.mean()
                    ridge = Ridge(design, weights)
            scale = np.exp(scale_design @ log_scale_coefficients)
            # The ridge's own unit of variance: that of a pair of weight 1.
            unit = float(np.exp(np.mean(np.log(scale**2 * weights))))
            unknown = np.sqrt(unit * np.sum((point_designs[base[j]] @ fit.root) ** 2, axis=1))
            coefficients[j] = fit.coefficients
            scale_coefficients[j] = log_scale_coefficients
            unknown_coefficients[j] = smooth.fit(np.log(np.maximum(unknown, 1e-9))).coefficients
            residuals[:, j] = left
            white[:, j] = noise / scale
            change = (design @ fit.root) @ fit.root.T
            influence[j] = -change * (weights * left)[:, None]
        return cls(
            bases=bases,
            base=base,
            coefficients=coefficients,
            scale_basis=scale_basis,
            scale_coefficients=scale_coefficients,
            unknown_coefficients=unknown_coefficients,
            noise=Noise.fit(white),
            shift=shift,
            spread=spread,
            leftover=Leftover(residuals, white, influence),
        )

    def predict(self, u: Array) -> Prediction:
        """Returns what is expected at `u` (n, p)."""
        means = np.empty((len(u), len(self.base)))
        for number, basis in enumerate(self.bases):
            mine = self.base == number
            if mine.any():
                means[:, mine] = basis(u) @ self.coefficients[mine].T
        design = self.scale_basis(u)
        scales = np.exp(design @ self.scale_coefficients.T)
        unknown = np.exp(design @ self.unknown_coefficients.T)
        return Prediction(
            self.shift + self.spread * means, self.spread * scales, self.spread * unknown
        )

    def log_likelihood(self, y: Array, prediction: Prediction, *, power: float = 1.0) -> Array:
        """Returns log p(y | u) of one observation `y` (s,) or (n, s) at each predicted u, (n,)."""
        total = np.hypot(prediction.scales, prediction.unknown)
        return power * self.noise.log_density(y - prediction.means, total)

    def simulate(self, u: Array, generator: np.random.Generator, *, inflation: float = 1.0) -> Array:
        """Returns one observation at each row of `u` (n, p), the means' uncertainty included."""
        prediction = self.predict(u)
        total = inflation * np.hypot(prediction.scales, prediction.unknown)
        return prediction.means + total * self.noise.sample(len(u), generator)


def _spread_points(u: Array, count: int) -> Array:
    """Training points and points between pairs of them: where the emulator will be asked."""
    generator = np.random.default_rng(0)
    first, second = generator.integers(len(u), size=(2, count))
    share = generator.random((count, 1))
    mixed = share * u[first] + (1 - share) * u[second]
    mixed[: count // 2] = u[first[: count // 2]]
    return mixed
