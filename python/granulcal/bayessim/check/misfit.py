r"""Is an observation inside the model? Its residual at the best fit, against held-out simulations.

The emulator of all signal axes is fitted to the mean $\bar y$ of k pours,

$$ Q = \min_u (\bar y - m(u))^T V_k^{-1} (\bar y - m(u)) $$

(V_k of `likelihood.py`), and what is left is a residual for each statistic. A prior-predictive test
asks whether a pour is one that the prior can make; this one asks whether *any* parameters make it,
after the best of them is taken away. An effect that mimics a change of the parameters cannot be
seen by either.

For one pour the same is done with the held-out pairs of each fold, which no emulator has seen:
p-values are ranks among them, so that the false alarm rate is what it says (conformal). For k pours
the replicates are means of k such residuals around the fit; of their variance only the share
$a / c^2$ (a of `likelihood.py`, c the widening) is the pours' own, and the rest an error of the
emulator, which they share and which does not average away.

Reference:
    Bayarri and Berger, P values for composite null models, JASA 95, 2000.
    Westfall and Young, Resampling-based multiple testing, 1993 (largest of several statistics).
    Vovk, Gammerman and Shafer, Algorithmic learning in a random world, 2005 (ranks as p-values).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.emulator.emulator import Prediction
from granulcal.bayessim.emulator.likelihood import Fold, Likelihood
from granulcal.bayessim.emulator.pooling import averaging_share, pooled_scales

__all__ = ["Misfit", "MisfitReference", "StatisticMisfit"]

Array = NDArray[np.float64]

_STEPS = 3
_DIFFERENCE = 1e-3
_REPLICATES = 199
SIGNIFICANCE = 0.05


@dataclass(frozen=True)
class StatisticMisfit:
    """Residual of one statistic at the best fit.

    Attributes:
        name: the statistic.
        residual: observed less fitted, in standard deviations of held-out residuals.
        p_value: chance of one so large among all statistics, if the model is right.
    """

    name: str
    residual: float
    p_value: float


@dataclass(frozen=True)
class Misfit:
    """Whether any parameters explain an observation.

    Attributes:
        pours: number of pours k.
        p_value: of joint and single residuals together; small if no parameters explain them.
        joint_p_value: of Q.
        statistics: each statistic, largest residual first.
    """

    pours: int
    p_value: float
    joint_p_value: float
    statistics: tuple[StatisticMisfit, ...]

    @property
    def is_inside(self) -> bool:
        """Whether the model explains the observation; wrong in 5 % of right models."""
        return self.p_value >= SIGNIFICANCE

    def __str__(self) -> str:
        """One or two lines."""
        what = "this pour" if self.pours == 1 else f"these {self.pours} pours"
        if self.is_inside:
            return f"inside the model: some parameters explain {what} (p = {self.p_value:.2g})"
        worst = [s for s in self.statistics if s.p_value < SIGNIFICANCE] or self.statistics[:1]
        shown = ", ".join(f"{s.name} {s.residual:+.1f} sd" for s in worst[:4])
        return (
            f"OUTSIDE THE MODEL: no parameters explain {what} (p = {self.p_value:.2g}); largest "
            f"residuals: {shown}. The posterior below is of the model's best compromise."
        )


@dataclass(frozen=True)
class MisfitReference:
    """Residuals of held-out pairs.

    Attributes:
        squares: Q of each pair, shape (h,).
        residuals: residual at the fit of each pair, standardised statistics, shape (h, s).
        noise: residual at the true parameters of each pair, signal axes, shape (h, s).
    """

    squares: Array
    residuals: Array
    noise: Array

    @classmethod
    def of(cls, folds: Sequence[Fold], u: Array, z: Array) -> "MisfitReference":
        """Returns the residuals of all held-out pairs `u` (n, p), `z` (n, s) of the folds."""
        squares, residuals, noise = [], [], []
        for fold in folds:
            y = fold.likelihood.axes.apply(z[fold.held])
            noise.append(y - fold.likelihood.emulator.predict(u[fold.held]).means)
            back = np.linalg.inv(fold.likelihood.axes.matrix)
            at_cells = fold.likelihood.everything_at_cells
            for row in y:
                square, left = _best_fit(fold.likelihood, at_cells, row, 1)[1:]
                squares.append(square)
                residuals.append(left @ back)
        return cls(np.array(squares), np.array(residuals), np.concatenate(noise))

    def test(self, likelihood: Likelihood, z: Array, names: Sequence[str]) -> Misfit:
        """Returns the test of k pours `z` (k, s), standardised; `names` are the statistics."""
        pours = len(z)
        back = np.linalg.inv(likelihood.axes.matrix)
        at_cells = likelihood.everything_at_cells
        y = likelihood.axes.apply(z)
        mean = y.mean(axis=0)
        # Which share of the noise is the pours' own is asked once, at the best cell.
        nearest = int(_squares(likelihood, at_cells, mean, pours, 1.0).argmin())
        share = float(averaging_share(y, at_cells.scales[nearest : nearest + 1])[0])
        best, square, left = _best_fit(likelihood, at_cells, mean, pours, share)
        null_squares, null_residuals = self.squares, self.residuals
        if pours > 1:
            null_squares, null_residuals = self._replicates(likelihood, best, pours, share)
        spread = np.maximum(null_residuals.std(axis=0), 1e-12)
        sizes = (left @ back) / spread
        null_largest = np.abs(null_residuals / spread).max(axis=1)
        joint = _p_value(null_squares, square)
        single = np.array([_p_value(null_largest, abs(size)) for size in sizes])
        # The smaller of two p-values, itself ranked among held-out pairs.
        nulls = np.minimum(
            [_p_value(null_squares, q) for q in null_squares],
            [_p_value(null_largest, r) for r in null_largest],
        )
        smallest = min(joint, float(single.min()))
        p_value = (1 + np.sum(nulls <= smallest)) / (1 + len(nulls))
        order = np.argsort(-np.abs(sizes))
        statistics = tuple(
            StatisticMisfit(names[int(i)], float(sizes[i]), float(single[i])) for i in order
        )
        return Misfit(pours, float(p_value), joint, statistics)

    def _replicates(
        self, likelihood: Likelihood, u: Array, pours: int, share: float
    ) -> tuple[Array, Array]:
        """Q and residuals of sets of pours at `u` (p,)."""
        generator = np.random.default_rng(0)
        here = likelihood.emulator.predict(u[None])
        shared = 1 - share * likelihood.widening**-2
        root = likelihood.emulator.noise.root
        back = np.linalg.inv(likelihood.axes.matrix)
        squares, residuals = [], []
        for _ in range(_REPLICATES):
            chosen = generator.integers(len(self.noise), size=pours + 1)
            own, common = self.noise[chosen[:-1]].mean(axis=0), self.noise[chosen[-1]]
            unknown = here.unknown[0] * (root @ generator.standard_normal(len(root)))
            error = np.sqrt(1 - shared) * own + np.sqrt(shared) * common + unknown
            # A fit near u is no better than the best one: false alarms can only become fewer.
            square, left = _improve(likelihood, u, here.means[0] + error, pours, share)[1:]
            squares.append(square)
            residuals.append(left @ back)
        return np.array(squares), np.array(residuals)


def _squares(
    likelihood: Likelihood, prediction: Prediction, mean: Array, pours: int, share: float
) -> Array:
    """Returns Q at each predicted point, shape (n,)."""
    scales = pooled_scales(prediction, pours, likelihood.widening, share)
    return likelihood.emulator.noise.square(mean - prediction.means, scales)


def _best_fit(
    likelihood: Likelihood, at_cells: Prediction, mean: Array, pours: int, share: float = 1.0
) -> tuple[Array, float, Array]:
    """Returns the best u (p,), Q there and the residual (s,): best cell, then Gauss-Newton."""
    squares = _squares(likelihood, at_cells, mean, pours, share)
    return _improve(likelihood, likelihood.cells[int(squares.argmin())], mean, pours, share)


def _improve(
    likelihood: Likelihood, u: Array, mean: Array, pours: int, share: float
) -> tuple[Array, float, Array]:
    """Returns a better u (p,), Q there and the residual (s,), by Gauss-Newton from `u`."""
    emulator = likelihood.emulator
    whiten = np.linalg.inv(emulator.noise.root).T

    def squares(prediction: Prediction) -> Array:
        return _squares(likelihood, prediction, mean, pours, share)

    # The emulator knows nothing beyond the prior, which may have no bounds of its own.
    low, high = likelihood.cells.min(axis=0), likelihood.cells.max(axis=0)
    here = emulator.predict(u[None])
    square = float(squares(here)[0])
    for _ in range(_STEPS):
        around = emulator.predict(u + _DIFFERENCE * np.eye(len(u)))
        scales = pooled_scales(here, pours, likelihood.widening, share)[0]
        slopes = ((around.means - here.means) / _DIFFERENCE / scales) @ whiten
        left = ((mean - here.means[0]) / scales) @ whiten
        step = np.linalg.lstsq(slopes.T, left, rcond=None)[0]
        tried = np.clip(u + step, low, high)
        there = emulator.predict(tried[None])
        if float(squares(there)[0]) >= square:
            break
        u, here, square = tried, there, float(squares(there)[0])
    return u, square, mean - here.means[0]


def _p_value(null: Array, observed: float) -> float:
    return float((1 + np.sum(null >= observed)) / (1 + len(null)))
