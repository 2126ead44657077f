"""Posterior of the free parameters given an observation: draws, density, regions, marginals."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal import _native
from granulcal.bayessim.arrays import as_matrix, known
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.posterior.average import EMULATOR_ALONE, NETWORK_ALONE, Average
from granulcal.bayessim.posterior.coordinates import coordinates_of
from granulcal.bayessim.posterior.doubts import (
    Doubt,
    FewEffectiveDraws,
    MassOutsidePrior,
    OutOfRange,
    PoursDisagree,
    doubts_of,
)
from granulcal.bayessim.posterior.marginal import CredibleRegion, Marginal, kernel_density
from granulcal.digits import told_apart
from granulcal.one_thread import one_thread
from granulcal.prior import Prior
from granulcal.real import check_real
from granulcal.short_names import short_names
from granulcal.whole import check_seed, check_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "CredibleRegion",
    "FewEffectiveDraws",
    "Marginal",
    "MassOutsidePrior",
    "OutOfRange",
    "Posterior",
    "PoursDisagree",
]

Array = NDArray[np.float64]

# Draws behind means, regions and marginals; a quantile of them is good to about 1 %.
_SUMMARY_DRAWS = 10_000


class Posterior:
    """Distribution of the free parameters after one or several pours.

    Parameters are in the prior's own units, one column for each of `names`, and never outside the
    prior's bounds.

    Attributes:
        prior: the prior.
        density: the density over the prior's coordinates, evaluated by the extension.
        warnings: what a reader must know before trusting the numbers; empty if nothing. Nothing is
            raised of it: `repr` counts and names them, `str` of each says it in a line.

    Examples:
        >>> from granulcal.bayessim.check.toys import LinearGaussian
        >>> toy = LinearGaussian.random(bounded=True)
        >>> theta, x = toy.simulate(1)
        >>> posterior = toy.posterior(x[0])
        >>> draws = posterior.sample(1000, seed=3)
        >>> bool(posterior.credible_region(0.9).contains(posterior.mode())[0])
        True
    """

    def __init__(
        self, prior: Prior, density: _native.Posterior, *, warnings: tuple[Doubt, ...] = ()
    ) -> None:
        """Joins a prior and a density over its coordinates.

        Raises:
            TypeError: one is something else.
        """
        if not isinstance(prior, Prior):
            raise TypeError(f"prior must be a Prior, got {prior!r}")
        if not isinstance(density, _native.Posterior):
            raise TypeError(
                f"density must be the extension's, as `from_mixture` makes it, got {density!r}"
            )
        self.prior = prior
        self.density = density
        self.warnings = (*warnings, *doubts_of(density))
        self._summary: tuple[Array, Array] | None = None
        self._last: tuple[tuple[int, int], Array] | None = None

    @classmethod
    def from_mixture(cls, prior: Prior, mixture: Mixture, **options: Any) -> Posterior:
        """Returns the posterior that is `mixture` in coordinates, cut to the prior's bounds."""
        return cls.from_mixtures(prior, [mixture], **options)

    @classmethod
    def from_mixtures(
        cls, prior: Prior, mixtures: list[Mixture], *, warnings: tuple[Doubt, ...] = ()
    ) -> Posterior:
        r"""Returns the posterior of k pours of one material, given each pour's own mixture.

        Given the parameters the pours are independent, so for k > 1 this is

        $$ p(u | x_1, ..., x_k) \propto p(u)^{1 - k} \prod_i p(u | x_i) $$

        by importance sampling; it is not the average of the pours' posteriors. Errors of the
        mixtures are multiplied as well: of a network, whose error is the same for all pours, ask
        `from_average`.
        """
        product = replace(NETWORK_ALONE, network=float(len(mixtures)))
        return cls._of(prior, [], mixtures, product, warnings)

    @classmethod
    def from_conditions(
        cls,
        prior: Prior,
        conditions: list[tuple[Likelihood, Array]],
        *,
        warnings: tuple[Doubt, ...] = (),
    ) -> Posterior:
        """Returns the posterior of one material under one or several conditions.

        Args:
            prior: the prior.
            conditions: for each the emulated likelihood and its k standardised pours, shape (k, s).
            warnings: what is known beforehand.
        """
        return cls._of(prior, conditions, [], EMULATOR_ALONE, warnings)

    @classmethod
    def from_average(
        cls,
        prior: Prior,
        condition: tuple[Likelihood, Array],
        mixtures: list[Mixture],
        average: Average,
        *,
        warnings: tuple[Doubt, ...] = (),
    ) -> Posterior:
        r"""Returns the average of an emulator's and a network's posterior of k pours.

        $$ p(u \mid x_1, \ldots, x_k) \propto p(u) \, L_k(u)^a \,
           \prod_i \Big(\frac{q(u \mid x_i)}{p(u)}\Big)^{b / k} $$

        with the emulator's likelihood L of k pours of one material and the network's mixture q of
        each; the network's errors are the same for all pours, so that all of them together count
        as one, of a network alone (a = 0, b = 1) too. The arithmetic average is for one pour:
        several are the emulator's alone.

        Args:
            prior: the prior.
            condition: the emulated likelihood and the pours, standardised, shape (k, s).
            mixtures: the network's of each pour, over coordinates.
            average: form and weights.
            warnings: what is known beforehand.
        """
        return cls._of(prior, [condition], mixtures, average, warnings)

    @classmethod
    def _of(
        cls,
        prior: Prior,
        conditions: list[tuple[Likelihood, Array]],
        mixtures: list[Mixture],
        average: Average,
        warnings: tuple[Doubt, ...],
    ) -> Posterior:
        density = _native.Posterior(
            coordinates_of(prior),
            [(likelihood.native, np.ascontiguousarray(z)) for likelihood, z in conditions],
            [mixture.arrays for mixture in mixtures],
            (average.form, average.emulator, average.network),
        )
        return cls(prior, density, warnings=warnings)

    @property
    def names(self) -> list[str]:
        """Paths of the parameters, in the order of the columns."""
        return self.prior.names

    @one_thread()
    def sample(self, n: int, seed: int = 0) -> Array:
        """Returns `n` draws, own units, shape (n, p); the same seed gives the same draws."""
        check_whole("n", n, at_least=0)
        check_seed(seed)
        # Checks ask the same draws one after the other.
        if self._last is None or self._last[0] != (n, seed):
            coordinates = self.density.sample(n, seed)
            self._last = (n, seed), self.prior.from_unconstrained(coordinates)
        return self._last[1].copy()

    @one_thread()
    def log_prob(self, theta: ArrayLike) -> Array:
        """Returns the log density at `theta` (n, p) or (p,), shape (n,); -inf outside the bounds.

        The density is with respect to the parameters' own units and integrates to 1.

        Raises:
            ValueError: another shape, or a parameter that is NaN.
        """
        values = as_matrix("theta", theta, columns=len(self.names))
        result = self.coordinate_log_prob(values)
        inside = np.isfinite(result)
        result[inside] += self.prior.log_slope(values[inside])
        return result

    @one_thread()
    def coordinate_log_prob(self, theta: ArrayLike) -> Array:
        """Returns the log density of the coordinates of `theta` (n, p), shape (n,).

        This is the density that modes and regions are about: in coordinates a uniform or
        log-uniform prior is flat.

        Raises:
            ValueError: another shape, or a parameter that is NaN.
        """
        values = known(as_matrix("theta", theta, columns=len(self.names)), self.names)
        low, high = self.prior.bounds.T
        inside = np.all((values >= low) & (values <= high), axis=1)
        result = np.full(len(values), -np.inf)
        result[inside] = self.density.log_prob(self.prior.to_unconstrained(values[inside]))
        return result

    @one_thread()
    def mean(self) -> Array:
        """Returns the means, own units, shape (p,), over 10,000 draws."""
        return self.prior.from_unconstrained(self._draws()[0]).mean(axis=0)

    @one_thread()
    def mode(self) -> Array:
        """Returns the parameters of highest density in coordinates, own units, shape (p,).

        Found by climbing from the best draws with random steps that shrink; always the same.
        """
        return self.prior.from_unconstrained(self.density.mode()[None])[0]

    def settings(self, theta: ArrayLike | None = None) -> dict[str, float]:
        """Returns the value of every parameter of the prior by its path, for `Scene.with_`.

        Those that the prior fixes are part of the material, too.

        Args:
            theta: own units, shape (p,); the mode unless given.
        """
        values = as_matrix(
            "theta", self.mode() if theta is None else theta, columns=len(self.names)
        )
        if len(values) != 1:
            raise ValueError(f"theta must be one row of parameters, got {len(values)}")
        return {**self.prior.fixed, **dict(zip(self.names, values[0].tolist(), strict=True))}

    @one_thread()
    def credible_region(self, level: float = 0.9) -> CredibleRegion:
        """Returns central intervals and the highest-density region of probability `level`.

        Raises:
            TypeError: the level is no number.
            ValueError: it does not lie between 0 and 1.
        """
        check_real("level", level)
        if not 0 < level < 1:
            raise ValueError(f"level must lie between 0 and 1, got {level}")
        draws, log_density = self._draws()
        tails = [(1 - level) / 2, (1 + level) / 2]
        # Quantiles commute with the monotone coordinates.
        intervals = self.prior.from_unconstrained(np.quantile(draws, tails, axis=0)).T
        threshold = float(np.quantile(log_density, 1 - level))
        return CredibleRegion(level, tuple(self.names), intervals, threshold, self)

    def to_arviz(self, draws: int = 4000, *, chains: int = 4, seed: int = 0) -> Any:
        """Returns the posterior as an ArviZ `InferenceData`, with draws of the prior beside it.

        The draws are independent: chains are there because ArviZ wants some.

        Args:
            draws: in all, split over the chains.
            chains: how many.
            seed: of the draws.

        Raises:
            ModuleNotFoundError: arviz is not installed (`granulcal[arviz]`).
        """
        try:
            import arviz  # pyright: ignore[reportMissingImports]
        except ModuleNotFoundError as error:
            told = "arviz is not installed: pip install 'granulcal[arviz]'; sample() is arrays"
            raise ModuleNotFoundError(told, name=error.name) from None

        if chains < 1 or draws < chains:
            raise ValueError(f"draws must be at least chains, and chains 1, got {draws}, {chains}")
        each = draws // chains

        def split(values: Array) -> dict[str, Array]:
            columns = values.reshape(chains, each, len(self.names))
            return {name: columns[:, :, i] for i, name in enumerate(self.names)}

        found = split(self.sample(chains * each, seed))
        groups = {"posterior": found, "prior": split(self.prior.sample(chains * each, seed))}
        # Before 1.0, which Python 3.11 has, groups are arguments by their names.
        if int(arviz.__version__.split(".")[0]) < 1:
            return arviz.from_dict(**groups)
        return arviz.from_dict(groups)

    def __repr__(self) -> str:
        told = (f"{name} {numbers}" for name, numbers in self._in_words().items())
        kinds = dict.fromkeys(type(each).__name__ for each in self.warnings)
        count, plural = len(self.warnings), "s" * (len(self.warnings) > 1)
        noted = f"; {count} note{plural} in `warnings`: {', '.join(kinds)}" if count else ""
        return f"Posterior({', '.join(told)}; mode and 90 % interval{noted})"

    def _in_words(self) -> dict[str, str]:
        """Mode and 90 % interval of each parameter, by its name."""
        region, mode = self.credible_region(0.9), self.mode()
        found = {}
        for i, name in enumerate(self.names):
            best, low, high = told_apart([float(mode[i]), *region[name]], least=3)
            found[name] = f"{best} ({low} to {high})"
        return found

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a Posterior stays in its process: hand over sample(n), or the model and the statistics"
        )

    def _repr_html_(self) -> str:
        from granulcal.html import page, picture

        rows = self._in_words()
        rows |= {f"note {i}": str(warning) for i, warning in enumerate(self.warnings, start=1)}

        def draw(figure: Any) -> None:
            panels = figure.subplots(1, len(self.names), squeeze=False)[0]
            short, marginals = short_names(self.names), self.marginals().values()
            for axes, name, marginal in zip(panels, short, marginals, strict=True):
                axes.fill_between(marginal.grid, marginal.density, alpha=0.4)
                axes.set_xlabel(name)
                axes.set_yticks([])

        drawn = picture(draw, width=2.6 * len(self.names), height=2.2)
        return page("Posterior: mode (90 % interval)", rows, drawn)

    @one_thread()
    def marginals(self, *, grid: int = 200) -> dict[str, Marginal]:
        """Returns the marginal of each parameter by name, on `grid` points, at least 2.

        Raises:
            TypeError: `grid` is no whole number.
            ValueError: it is less than 2.
        """
        check_whole("grid", grid, at_least=2)
        draws = self._draws()[0]
        result = {}
        for i, parameter in enumerate(self.prior.free):
            points, density = kernel_density(draws[:, i], parameter.coordinate_bounds, grid)
            values = parameter.from_coordinate(np.quantile(draws[:, i], [0.05, 0.5, 0.95]))
            result[parameter.path] = Marginal(
                parameter.path,
                parameter.from_coordinate(points),
                density,
                float(values[1]),
                (float(values[0]), float(values[2])),
            )
        return result

    def pair_plot(
        self,
        path: str | PathLike[str] | None = None,
        truth: ArrayLike | None = None,
        extra: Posterior | None = None,
        title: str = "",
    ) -> Figure:
        """Returns a figure of all marginals, and of each pair the regions of 50 % and 90 %.

        Args:
            path: where to save the figure, or None.
            truth: true parameters to mark, own units, shape (p,).
            extra: another posterior of the same parameters to draw beside this one.
            title: over the figure.
        """
        from granulcal.bayessim.posterior.pair_plot import pair_plot

        return pair_plot(self, path=path, truth=truth, extra=extra, title=title)

    def _draws(self) -> tuple[Array, Array]:
        """Fixed draws of the coordinates and their log densities, made once."""
        if self._summary is None:
            draws = self.density.sample(_SUMMARY_DRAWS, 0)
            self._summary = draws, self.density.log_prob(draws)
        return self._summary
