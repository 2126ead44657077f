r"""Is an observation inside the model? Its residual at the best fit, against held-out simulations.

The emulator of all signal axes is fitted to the mean $\bar y$ of k pours,

$$ Q = \min_u (\bar y - m(u))^T V_k^{-1} (\bar y - m(u)) $$

(V_k of `likelihood.py`), and what is left is a residual for each statistic. A prior-predictive test
asks whether a pour is one that the prior can make; this one asks whether *any* parameters make it,
after the best of them is taken away. An effect that mimics a change of the parameters cannot be
seen by either.

For one pour the same is done with the held-out pairs of each fold, which no emulator has seen:
p-values are ranks among them, so that the false alarm rate is what it says (conformal). For k pours
the replicates are means of k such residuals around the fit, scaled to the noise there; of their
variance only the share $\eta / c^2$ (of `likelihood.py`; c the widening) is the pours' own, and the
rest an error of the emulator, which they share and which does not average away. Pours of two
materials may have the mean of a third, so that their scatter about it,

$$ W = \sum_{ij} (1 - s_j^2) (y_{ij} - \bar y_j)^2 / s_j^2 $$

with the noise s at the fit (an axis has variance 1 over the prior, so that 1 - s^2 is what shows of
the parameters there), is ranked among that of as many held-out residuals, and the smallest p-value
of all is ranked once more.

One wrong recording among ten moves their mean by a tenth of what is wrong with it, which none of
these need see. The largest of the squared distances of a pour from the mean of the others,

$$ d_i = \frac{k}{k - 1} \sum_j (y_{ij} - \bar y_j)^2 / s_j^2, $$

is ranked among that of as many held-out residuals, and so is its share of their sum: where all
pours differ by more than the model's, none is odd. What is told of an odd pour is no part of the
p-values.

Evaluated by the extension (`crates/bayessim/src/misfit.rs`).

Reference:
    Bayarri and Berger, P values for composite null models, JASA 95, 2000.
    Westfall and Young, Resampling-based multiple testing, 1993 (largest of several statistics).
    Vovk, Gammerman and Shafer, Algorithmic learning in a random world, 2005 (ranks as p-values).
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.bayessim.emulator.likelihood import Fold, Likelihood

__all__ = ["Misfit", "MisfitReference", "OddPour", "StatisticMisfit"]

Array = NDArray[np.float64]

# A model that is right is called wrong as often as this.
SIGNIFICANCE = _native.SIGNIFICANCE


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
class OddPour:
    """A pour that lies farther from the others than pours of one material do.

    Attributes:
        number: of the pour, from 1.
        times: its distance from the mean of the others over that of a pour of the same material.
        p_value: chance of a distance as large, if all are of one material; at most 0.002.
    """

    number: int
    times: float
    p_value: float


@dataclass(frozen=True)
class Misfit:
    """Whether any parameters explain an observation.

    Attributes:
        pours: number of pours k.
        p_value: of joint and single residuals and of the scatter together; small if no parameters
            explain them.
        joint_p_value: of Q.
        statistics: each statistic, largest residual first.
        text: the same in words.
        scatter_p_value: of how much several pours differ from each other; None of one pour.
        odd_pour: of three or more the one that is not of their material, if one is that far off.
    """

    pours: int
    p_value: float
    joint_p_value: float
    statistics: tuple[StatisticMisfit, ...]
    text: str = field(default="", repr=False, compare=False)
    scatter_p_value: float | None = None
    odd_pour: OddPour | None = None

    @property
    def is_inside(self) -> bool:
        """Whether the model explains the observation; wrong in 5 % of right models."""
        return self.p_value >= SIGNIFICANCE

    @property
    def is_of_several(self) -> bool:
        """Whether what speaks most against the model is how much the pours differ: see `text`."""
        others = min([self.joint_p_value, *(each.p_value for each in self.statistics)])
        scatter = self.scatter_p_value
        return not self.is_inside and scatter is not None and scatter <= others

    def __str__(self) -> str:
        """One to three lines."""
        return self.text


@dataclass(frozen=True)
class MisfitReference:
    """Residuals of held-out pairs.

    Attributes:
        squares: Q of each pair, shape (h,).
        residuals: residual at the fit of each pair, standardised statistics, shape (h, s).
        noise: residual at the true parameters of each pair, signal axes, shape (h, s), in the
            emulator's standard deviations there, so that it is noise anywhere.
        is_unit: false of models of before, whose noise is in the axes' own units.
    """

    squares: Array
    residuals: Array
    noise: Array
    is_unit: bool = True

    @classmethod
    def of(cls, folds: Sequence[Fold], u: Array, z: Array) -> "MisfitReference":
        """Returns the residuals of all held-out pairs `u` (n, p), `z` (n, s) of the folds."""
        squares, residuals, noise = [], [], []
        for fold in folds:
            likelihood, held = fold.likelihood, z[fold.held]
            y = likelihood.axes.apply(held)
            expected = likelihood.emulator.predict(u[fold.held])
            noise.append((y - expected.means) / expected.scales)
            at_fit = likelihood.native.best_fits(np.ascontiguousarray(held))
            squares.append(at_fit[0])
            residuals.append(at_fit[1])
        return cls(np.concatenate(squares), np.concatenate(residuals), np.concatenate(noise))

    def arrays(self) -> dict[str, Array]:
        """Returns the arrays by their names in a model's file."""
        return {
            "misfit_squares": self.squares,
            "misfit_residuals": self.residuals,
            "misfit_unit_noise" if self.is_unit else "misfit_noise": self.noise,
        }

    def test(self, likelihood: Likelihood, z: Array, names: Sequence[str]) -> Misfit:
        """Returns the test of k pours `z` (k, s), standardised; `names` are the statistics."""
        arrays = {name: np.ascontiguousarray(array) for name, array in self.arrays().items()}
        p_value, joint, scatter, statistics, odd, text = likelihood.native.misfit(
            arrays, np.ascontiguousarray(z), list(names)
        )
        each = tuple(StatisticMisfit(*found) for found in statistics)
        odd_pour = None if odd is None else OddPour(*odd)
        return Misfit(len(z), p_value, joint, each, text, scatter, odd_pour)
