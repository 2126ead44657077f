r"""One observation, few simulations: rounds of pours where the posterior may still be.

A round fits the emulator to all pours so far and asks it where the observation can come from. The
next parameters are drawn from

$$ \tilde p(u) \propto (1 - d) p(u) L(u)^{1/2} + d p(u) $$

with L the emulated likelihood and a share d of the prior; of twice as many draws of the first part
as needed those are poured that lie farthest from all others, in spreads of the draws. The root
keeps rounds wider than the posterior while the emulator is poor; the prior's share finds what it
missed.

The posterior needs no correction for the proposal: the emulator is a regression of the statistics
on the parameters, which does not mind where the parameters came from, and the prior enters as
itself. Every pour counts, also those that fail.

Reference:
    Deistler, Goncalves and Macke, Truncated proposals for scalable and hassle-free simulation-based
    inference, NeurIPS 2022 (rounds without importance weights).
    Kennard and Stone, Computer aided design of experiments, Technometrics 11, 1969 (farthest next).
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.arrays import as_matrix, as_real
from granulcal.bayessim.check.misfit import Misfit
from granulcal.bayessim.emulator.likelihood import EmulatorChoice
from granulcal.bayessim.named import by_name
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.training.round_fit import RoundFit, first_design
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.one_thread import one_thread
from granulcal.pours.left_out import LeftOut
from granulcal.prior import Prior, require_prior
from granulcal.short_names import short_names
from granulcal.whole import check_whole

__all__ = ["Round", "SequentialFit", "infer_within_budget", "round_sizes", "rounds_of"]

Array = NDArray[np.float64]

FEWEST_PAIRS = 20
_FEWEST_BUDGET = 60
_FIRST_SHARE = 0.4
# Power of the likelihood that each later round is drawn by.
_POWERS = (0.5, 0.5, 0.5)


@dataclass(frozen=True)
class Round:
    """What is known after a round.

    Attributes:
        number: from 1.
        rounds: rounds in all.
        pours: poured so far.
        usable: of them, with statistics.
        budget: pours in all.
        spread: standard deviations of the posterior over those of the prior, shape (p,).
        names: paths of the parameters.
    """

    number: int
    rounds: int
    pours: int
    usable: int
    budget: int
    spread: Array
    names: tuple[str, ...] = ()

    def __str__(self) -> str:
        """One line."""
        words = short_names(self.names) or [""] * len(self.spread)
        each = zip(words, self.spread, strict=True)
        spread = ", ".join(f"{word} {share:.2f}".strip() for word, share in each)
        return (
            f"round {self.number} of {self.rounds}: {self.pours} of {self.budget} pours, "
            f"{self.usable} usable; spread of the posterior over the prior's: {spread}"
        )


@dataclass(frozen=True)
class SequentialFit:
    """The posterior of one observation within a budget.

    Attributes:
        posterior: of the parameters.
        misfit: whether the observation is inside the model.
        choice: what held-out pours say of the emulator.
        theta: parameters of all pours, own units, shape (n, p).
        x: their statistics, NaN where there are none, shape (n, s).
        rounds: what was known after each.
        left_out: pours that could not be used, by why.
    """

    posterior: Posterior
    misfit: Misfit
    choice: EmulatorChoice
    theta: Array
    x: Array
    rounds: tuple[Round, ...]
    left_out: LeftOut = field(default_factory=LeftOut)


def round_sizes(budget: int) -> list[int]:
    """Returns the pours of each round: two fifths from the prior, then three equal rounds.

    Raises:
        TypeError: not a whole number.
        ValueError: a budget below 60.
    """
    check_whole("budget", budget, at_least=_FEWEST_BUDGET)
    first = round(_FIRST_SHARE * budget)
    ends = np.linspace(first, budget, len(_POWERS) + 1).round().astype(int)
    return [first, *np.diff(ends).tolist()]


@one_thread()
def infer_within_budget(
    simulate: Callable[[Array, int], Array],
    prior: Prior,
    x_obs: ArrayLike,
    *,
    budget: int = 100,
    seed: int = 0,
    x_names: tuple[str, ...] | None = None,
    progress: Callable[[Round], None] | None = None,
) -> SequentialFit:
    """Returns the posterior given an observation, from `budget` simulations made for it.

    The same arguments and simulations give the same parameters, so that a simulator which
    remembers its rows makes a run resumable.

    Args:
        simulate: takes parameters in own units, shape (b, p), and the index of the first of them
            among all; returns their statistics, shape (b, s), a row of NaN for a pour without.
        prior: the prior.
        x_obs: one pour, shape (s,), or k of one material, shape (k, s); what carries names, as
            `BayesSim.posterior` takes it, is matched with `x_names` if they are given.
        budget: simulations in all.
        seed: seed of every random choice.
        x_names: names of the statistics.
        progress: called after each round.

    Raises:
        ObservationError: an observation that is not finite, or has other names.
        TrainingDataError: fewer than 20 pours of the first round can be used.
        TypeError: a budget that is no whole number, an observation that is no numbers, or a prior
            that is none.
        ValueError: a budget below 60, or a masked observation.
    """
    require_prior(prior)

    def pour(design: Array, first: int) -> tuple[Array, Array]:
        return design, as_matrix(
            "simulated statistics", simulate(prior.from_unconstrained(design), first)
        )

    return rounds_of(
        pour, prior, x_obs, budget=budget, seed=seed, x_names=x_names, progress=progress
    )


def rounds_of(
    pour: Callable[[Array, int], tuple[Array, Array]],
    prior: Prior,
    x_obs: ArrayLike,
    *,
    budget: int,
    seed: int = 0,
    x_names: tuple[str, ...] | None = None,
    progress: Callable[[Round], None] | None = None,
) -> SequentialFit:
    """Returns the same from pours that need not be where they were asked for.

    Args:
        pour: takes coordinates, shape (b, p), and the index of the first of them among all;
            returns the coordinates that were poured, shape (b, p), and their statistics, (b, s).
        prior: the prior.
        x_obs: as in `infer_within_budget`, like the rest.
        budget: pours in all.
        seed: seed of every random choice.
        x_names: names of the statistics.
        progress: called after each round.
    """
    sizes = round_sizes(budget)
    if x_names is not None:
        x_obs = by_name("x_obs", x_obs, x_names, whose="x_names", error=ObservationError)
    observed = np.atleast_2d(as_real("x_obs", x_obs))
    if observed.ndim != 2 or not np.all(np.isfinite(observed)):
        raise ObservationError(f"x_obs must be finite, shape (s,) or (k, s), got {observed.shape}")
    names = x_names or tuple(f"statistic_{i}" for i in range(observed.shape[1]))
    u, x = np.empty((0, len(prior.names))), np.empty((0, observed.shape[1]))
    rounds: list[Round] = []
    fit: RoundFit | None = None
    for number, size in enumerate(sizes, start=1):
        design = (
            first_design(prior, size, seed)
            if fit is None
            else fit.next(u, size, seed + number, _POWERS[number - 2])
        )
        poured, statistics = pour(design, len(u))
        if statistics.shape != (size, observed.shape[1]):
            raise TrainingDataError(
                f"simulate must return shape {(size, observed.shape[1])}, got {statistics.shape}"
            )
        u, x = np.concatenate([u, poured]), np.concatenate([x, statistics])
        usable = np.all(np.isfinite(x), axis=1)
        if usable.sum() < FEWEST_PAIRS:
            raise TrainingDataError(
                f"at least {FEWEST_PAIRS} pours must be usable, {usable.sum()} of {len(u)} are: "
                "a larger budget or a narrower prior is needed"
            )
        fit = RoundFit.of(prior, u[usable], x[usable], observed, names, seed)
        draws = prior.to_unconstrained(fit.posterior.sample(2000))
        spread = draws.std(axis=0) / fit.likelihood.pool.std(axis=0)
        counts = (number, len(sizes), len(u), int(usable.sum()), budget)
        rounds.append(Round(*counts, spread, tuple(prior.names)))
        if progress is not None:
            progress(rounds[-1])
    assert fit is not None
    z = fit.standardiser.apply(observed, clip=False)
    misfit = fit.reference().test(fit.likelihood, z, names)
    theta = prior.from_unconstrained(u)
    # Of a simulator that says nothing but a row of NaN; who knows more puts it in its place.
    left_out = LeftOut(unseen=len(x) - rounds[-1].usable)
    return SequentialFit(fit.posterior, misfit, fit.choice, theta, x, tuple(rounds), left_out)
