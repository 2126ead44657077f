r"""Likelihood of the parameters by an emulator of the leading signal axes: its fit.

The statistics are rotated to their signal axes (`signal.py`); the first r of them are emulated, and
k pours with the mean $\bar y$ have

$$ L(u) = t_\nu(\bar y; m(u), V_k), \qquad
   V_k = c^2 (s^2 + h^2) - (1 - 1/k) \eta s^2 $$

(axis by axis, with one correlation R), s the scale of what the emulator leaves of a pour, h that of
what the pairs leave unknown about the mean, and $c \ge 1$ a widening. For one pour this is the
widened noise. Of many, only what differs between them averages away: pairs of which no two share
their parameters cannot tell noise from errors of the emulator, but several pours of one material
can, and $\eta$ is the share of $s^2$ by which they differ. The rest, the widening and h are errors
that all pours share.

Which r and c, and whether the noise changes over the parameters, is chosen by held-out pairs: the
parameters of pairs that an emulator has not seen are to be most probable under its posterior, among
those choices whose highest-density regions hold them as often as they claim.

Fitted here, evaluated by the extension (`crates/bayessim/src/likelihood.rs`) of parts that are in
memory. What stays beside it here is the choice among hundreds of forms at thousands of cells at
once, in single precision, which needs matrices of all pairs; a test holds the two together.

Reference:
    Wood, Statistical inference for noisy nonlinear ecological dynamic systems, Nature 466, 2010
    (synthetic likelihood).
    Grunwald and van Ommen, Inconsistency of Bayesian inference for misspecified linear models, and
    a proposal for repairing it, Bayesian Analysis 12, 2017 (widening by held-out prediction).
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple, TypedDict

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.bayessim.check.diagnostics import uniform_p_value
from granulcal.bayessim.emulator.basis import learn_length_scales
from granulcal.bayessim.emulator.emulator import Emulator, Prediction
from granulcal.bayessim.emulator.linear import linear_scores
from granulcal.bayessim.emulator.noise import Noise
from granulcal.bayessim.emulator.signal import SignalAxes
from granulcal.bayessim.posterior.coordinates import coordinates_of, quasi_prior
from granulcal.bayessim.replicates import dealt, firsts, material_of
from granulcal.prior import Prior
from granulcal.progress import steps

__all__ = ["EmulatorChoice", "Fold", "Likelihood"]

Array = NDArray[np.float64]

# Numbers of leading axes and factors on their noise among which held-out pairs choose.
AXIS_COUNTS = (3, 4, 6, 9, 12, 16)
WIDENINGS = (1.0, 1.12, 1.25, 1.4, 1.6, 1.8, 2.0, 2.5, 3.2, 4.0)
_FOLDS = 4
# Held-out pairs that choose, and that the fit is checked on afterwards.
_HELD_OUT = 240
_CELLS = 4096
# As near to its largest value, and as far below that of a linear regression, a score says nothing.
_AT_MOST = 0.5
# Points of the prior that a posterior is made of, unless too few of them carry weight.
_POOL = 16_384
# Levels of held-out truths must be uniform with at least this Kolmogorov-Smirnov p-value.
_LEAST_P_VALUE = 0.1


@dataclass(frozen=True)
class EmulatorChoice:
    """What held-out pairs say of the emulator.

    Attributes:
        axis_count: leading signal axes emulated, r.
        widening: factor on their noise, c.
        varying_scale: whether the scale of the noise changes over the parameters.
        score: mean log posterior density at held-out parameters, coordinates [nat].
        linear_score: the same by a linear regression of the parameters on the statistics.
        prior_score: the same by the prior; 0 where all parameters are bounded and uniform or
            log-uniform.
    """

    axis_count: int
    widening: float
    varying_scale: bool
    score: float
    linear_score: float
    prior_score: float

    def __str__(self) -> str:
        """One line."""
        noise = "varying" if self.varying_scale else "constant"
        text = (
            f"{self.axis_count} signal axes, {noise} noise widened {self.widening:g} times; "
            f"log density of held-out pairs {self.score:.2f} (linear regression "
            f"{self.linear_score:.2f})"
        )
        if not self.is_decided:
            text += (
                "; UNDECIDED: posteriors are too small a part of the prior to choose the form by, "
                "and may be too wide; a narrower prior, or calibrate, which pours in rounds, helps"
            )
        return text

    @property
    def is_decided(self) -> bool:
        """Whether held-out pairs could choose.

        A truth that alone of the prior's cells has weight is more probable than by the prior by
        the logarithm of their number, in whatever form of the emulator.
        """
        most = math.log(_CELLS + 1) - _AT_MOST
        return self.score - self.prior_score < most and self.linear_score < self.score + _AT_MOST


class Scalars(TypedDict):
    """Numbers of a likelihood that are no arrays."""

    widening: float
    degrees: float
    leading_degrees: float
    axis_count: int


class _Form(NamedTuple):
    """One choice of the emulator's form; among equals the first is taken."""

    varying_scale: bool
    axis_count: int
    heavy_tails: bool


@dataclass(frozen=True)
class Likelihood:
    """Density of standardised statistics given coordinates.

    Attributes:
        prior: the prior, over whose range the emulator holds.
        axes: rotation of the statistics.
        emulator: of all axes.
        leading: of the first r axes.
        widening: c.
    """

    prior: Prior
    axes: SignalAxes
    emulator: Emulator
    leading: Emulator
    widening: float

    @classmethod
    def fit(
        cls,
        u: Array,
        z: Array,
        prior: Prior,
        *,
        features: int,
        seed: int,
        order: NDArray[np.intp] | None = None,
    ) -> tuple["Likelihood", list["Fold"], EmulatorChoice]:
        """Returns the likelihood, the same fitted without each fold, and how it was chosen.

        Args:
            u: coordinates of the parameters, shape (n, p).
            z: standardised statistics, shape (n, s).
            prior: the prior of u.
            features: random frequencies of the emulator.
            seed: seed of the folds and the frequencies.
            order: rows in the order in which they are held out, shape (n,); None: at random.
        """
        everything = np.arange(len(u))
        lengths = learn_length_scales(
            u, SignalAxes.fit(_spread_one(u), z).apply(z), features=features, seed=seed
        )
        if order is None:
            order = np.random.default_rng((seed, 2)).permutation(len(u))
        parts = dealt(order, material_of(u), _FOLDS)
        counts = sorted({min(count, z.shape[1]) for count in AXIS_COUNTS})
        scores: dict[_Form, Array] = {}
        levels: dict[_Form, Array] = {}
        fits: dict[_Form, list[Likelihood]] = {}
        for varying in (False, True):
            for part in steps("emulator", parts):
                train = np.setdiff1d(everything, part)
                held = part[: _HELD_OUT // _FOLDS]
                grown = _Growing.fit(u[train], z[train], prior, lengths, features, varying, seed)
                at_cells = grown.emulator.predict(quasi_prior(prior, _CELLS))
                for heavy, count in product((False, True), counts):
                    found = grown.leading(count, heavy=heavy)
                    score, level = found.held_out_scores(u[held], z[held], at_cells.first(count))
                    key = _Form(varying, count, heavy)
                    scores[key] = np.column_stack([scores[key], score]) if key in scores else score
                    levels[key] = np.column_stack([levels[key], level]) if key in levels else level
                    fits.setdefault(key, []).append(found)
        held_out = np.concatenate([part[: _HELD_OUT // _FOLDS] for part in parts])
        # Levels of one material's pours hang together: one of each says whether they are uniform.
        alone = firsts(material_of(u[held_out]))
        honest = {key: each[:, alone] for key, each in levels.items()}
        best, chosen = _most_probable_of_the_honest(scores, honest)
        widening = WIDENINGS[chosen]
        linear = [
            linear_scores(u, z, np.setdiff1d(everything, part), part[: _HELD_OUT // _FOLDS])
            for part in parts
        ]
        choice = EmulatorChoice(
            best.axis_count,
            widening,
            best.varying_scale,
            float(scores[best][chosen].mean()),
            float(np.concatenate(linear).mean()),
            float(prior.coordinate_log_prob(u[held_out]).mean()),
        )
        folds = [
            Fold(fit.widened(widening), part[: _HELD_OUT // _FOLDS])
            for fit, part in zip(fits[best], parts, strict=True)
        ]
        grown = _Growing.fit(u, z, prior, lengths, features, best.varying_scale, seed)
        whole = grown.leading(best.axis_count, heavy=best.heavy_tails)
        return whole.widened(widening), folds, choice

    def widened(self, widening: float) -> "Likelihood":
        """Returns the same with another c."""
        return Likelihood(self.prior, self.axes, self.emulator, self.leading, widening)

    @property
    def axis_count(self) -> int:
        """Number r of leading axes."""
        return len(self.leading.shift)

    @cached_property
    def cells(self) -> Array:
        """Evenly spread draws of the prior, shape (c, p)."""
        return quasi_prior(self.prior, _CELLS)

    @cached_property
    def at_cells(self) -> Prediction:
        """What the leading emulator expects there."""
        return self.leading.predict(self.cells)

    @property
    def pool(self) -> Array:
        """More evenly spread draws of the prior, the cells first, shape (m, p)."""
        return quasi_prior(self.prior, _POOL)

    @cached_property
    def native(self) -> _native.Emulated:
        """The same as the extension evaluates it."""
        return _native.Emulated(
            coordinates_of(self.prior),
            {name: np.ascontiguousarray(array, float) for name, array in self.arrays().items()},
            statistics=len(self.axes.matrix),
            **self.scalars(),
        )

    def arrays(self) -> dict[str, Array]:
        """Returns its arrays by their names in a model's file."""
        emulator = self.emulator
        return {
            "emulator_axes": self.axes.matrix,
            "emulator_relevance": self.axes.relevance,
            "emulator_centre": emulator.scale_basis.centre,
            "emulator_scale": emulator.scale_basis.scale,
            "emulator_frequencies": emulator.basis.frequencies,
            "emulator_coefficients": emulator.coefficients,
            "emulator_scale_frequencies": emulator.scale_basis.frequencies,
            "emulator_scale_coefficients": emulator.scale_coefficients,
            "emulator_unknown_coefficients": emulator.unknown_coefficients,
            "emulator_root": emulator.noise.root,
            "emulator_leading_root": self.leading.noise.root,
            "emulator_y_shift": emulator.shift,
            "emulator_y_spread": emulator.spread,
        }

    def scalars(self) -> Scalars:
        """Returns its numbers that are no arrays, by their names in a model's file."""
        return Scalars(
            widening=self.widening,
            degrees=self.emulator.noise.degrees,
            leading_degrees=self.leading.noise.degrees,
            axis_count=self.axis_count,
        )

    def log_prob(self, z: Array, u: Array) -> Array:
        """Returns the log likelihood of k pours `z` (k, s) at `u` (n, p), shape (n,).

        Args:
            z: standardised statistics.
            u: coordinates.
        """
        return self.native.log_prob(np.ascontiguousarray(z), np.ascontiguousarray(u))

    def at_pool(self, z: Array) -> Array:
        """Returns the log likelihood of k pours `z` (k, s) at `pool`, shape (m,)."""
        return self.native.at_pool(np.ascontiguousarray(z))

    def held_out_scores(
        self, u: Array, z: Array, at_cells: Prediction | None = None
    ) -> tuple[Array, Array]:
        """Returns what the posteriors given `z` (n, s) say of the true `u` (n, p).

        Args:
            u: true coordinates.
            z: standardised statistics.
            at_cells: what is expected of the leading axes at `cells`, if known already.

        Returns:
            Log density and level of the smallest highest-density region that holds it, each of
            shape (widenings, n).
        """
        y = self.axes.apply(z)[:, : self.axis_count]
        noise, here = self.leading.noise, self.leading.predict(u)
        cells = self.at_cells if at_cells is None else at_cells
        # The truth is one of the cells, so that none can be more probable than all.
        squares = np.column_stack(
            [
                noise.squares(y, cells.means, np.hypot(cells.scales, cells.unknown)),
                noise.square(y - here.means, np.hypot(here.scales, here.unknown)),
            ]
        )
        sizes = np.log(np.hypot(cells.scales, cells.unknown)).sum(axis=1)
        sizes_here = np.log(np.hypot(here.scales, here.unknown)).sum(axis=1)
        offsets = np.column_stack([np.tile(sizes, (len(u), 1)), sizes_here])
        prior_here = self.prior.coordinate_log_prob(u)
        prior_cells = self.prior.coordinate_log_prob(self.cells)
        prior = np.column_stack([np.tile(prior_cells, (len(u), 1)), prior_here])
        half = np.float32(0.5 * (noise.degrees + self.axis_count))
        # Single precision: logarithms of a thousandth of a nat are enough, and there are millions.
        squares, offsets, prior = (a.astype(np.float32) for a in (squares, offsets, prior))
        scores, levels = np.empty((2, len(WIDENINGS), len(u)))
        for i, widening in enumerate(WIDENINGS):
            scale = np.float32(1 / (widening**2 * noise.degrees))
            fits = -half * np.log(1 + scale * squares) - offsets
            largest = fits.max(axis=1, keepdims=True)
            shares = np.exp(fits - largest)
            total = shares.sum(axis=1)
            evidence = np.log(total / shares.shape[1]) + largest[:, 0]
            scores[i] = fits[:, -1] - evidence + prior_here
            heights = fits + prior
            denser = heights[:, :-1] > heights[:, -1:]
            levels[i] = np.sum(shares[:, :-1] * denser, axis=1) / total
        return scores, levels

    def simulate(self, u: Array, generator: np.random.Generator) -> Array:
        """Returns one draw of the leading axes at each row of `u` (n, p), shape (n, r)."""
        return self.leading.simulate(u, generator, widening=self.widening)


@dataclass(frozen=True)
class Fold:
    """A likelihood and pairs that it has not seen.

    Attributes:
        likelihood: fitted without them.
        held: their rows, shape (h,).
    """

    likelihood: Likelihood
    held: NDArray[np.intp]


@dataclass(frozen=True)
class _Growing:
    """An emulator of all axes, of which any number of leading ones can be taken."""

    prior: Prior
    axes: SignalAxes
    emulator: Emulator
    white: Array

    @classmethod
    def fit(
        cls,
        u: Array,
        z: Array,
        prior: Prior,
        lengths: Array,
        features: int,
        varying: bool,
        seed: int,
    ) -> "_Growing":
        axes = SignalAxes.fit(_spread_one(u), z)
        emulator, white = Emulator.fit(
            u, axes.apply(z), lengths, features=features, varying_scale=varying, seed=seed
        )
        return cls(prior, axes, emulator, white)

    def leading(self, count: int, *, heavy: bool) -> Likelihood:
        leading = self.emulator.first(count, Noise.fit(self.white[:, :count], heavy=heavy))
        return Likelihood(self.prior, self.axes, self.emulator, leading, 1.0)


def _most_probable_of_the_honest(
    scores: dict[_Form, Array], levels: dict[_Form, Array]
) -> tuple[_Form, int]:
    """Key and index of the highest mean score among those whose levels may be uniform."""
    ranked = sorted(
        ((float(row.mean()), key, i) for key, rows in scores.items() for i, row in enumerate(rows)),
        reverse=True,
    )
    for _, key, i in ranked:
        if uniform_p_value(levels[key][i]) >= _LEAST_P_VALUE:
            return key, i
    return ranked[0][1:]


def _spread_one(u: Array) -> Array:
    spread = u.std(axis=0)
    return (u - u.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
