"""What `BayesSim.fit` does, step by step: emulator, network, the weights of both."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.check.misfit import MisfitReference
from granulcal.bayessim.emulator.likelihood import EmulatorChoice, Fold, Likelihood
from granulcal.bayessim.network.amortised import Amortised
from granulcal.bayessim.network.mixture import Mixture
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.network.trainer import Progress, TrainingResult
from granulcal.bayessim.posterior.average import EMULATOR_ALONE, NETWORK_ALONE, Average, HeldOut
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.replicates import firsts, in_turns, material_of, split
from granulcal.bayessim.training.config import Config
from granulcal.bayessim.training.pairs import TrainingPairs
from granulcal.bayessim.training.summary import TrainingSummary
from granulcal.errors import TrainingDataError
from granulcal.pours.scene import Scene
from granulcal.prior import Prior

__all__ = ["Trained", "told_not_of_prior", "train_model"]

Array = NDArray[np.float64]

# From 300 pairs on, at least 50 are spared to check a network.
_WORTHWHILE_TEST_PAIRS = 50
_PAIRS_FOR_A_WORTHWHILE_TEST = 300
# Fewer equal draws of the prior than a proposal's weighted pairs are worth have been overconfident.
_FEWEST_OF_PRIOR = 150
# Of a parameter's prior so much may lie where the proposal has no pairs.
_LARGEST_UNCOVERED = 0.01
# One of n values is at most sqrt(n) standard deviations out; there it has 4/5 of the variance.
_FAR = 0.9


@dataclass(frozen=True)
class Trained:
    """Parts of a trained model, and what it is to be checked with.

    Attributes:
        standardiser: of the statistics.
        likelihood: the emulator.
        amortised: the network, or None if the posterior is that of the emulator alone.
        average: how much both count in the posterior of one pour.
        misfit: residuals of held-out pairs.
        summary: what was done.
        posteriors: posteriors of pairs that were not trained on.
        truth: their parameters, own units, shape (t, p).
        chose_form: whether these pairs chose the emulator's form, or how much the network counts.
    """

    standardiser: Standardiser
    likelihood: Likelihood
    amortised: Amortised | None
    average: Average
    misfit: MisfitReference
    summary: TrainingSummary
    posteriors: list[Posterior]
    truth: Array
    chose_form: bool


def train_model(
    pairs: TrainingPairs,
    config: Config,
    seed: int,
    *,
    proposal: Prior | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> Trained:
    """Returns the trained parts.

    Args:
        pairs: usable pairs.
        config: settings; `config.method` says which way.
        seed: seed of every random choice.
        proposal: what the parameters were drawn from, if it was not the prior.
        progress: called after each pass of a network.
    """
    started = time.process_time()
    work = _Work(pairs, config, seed, proposal, progress)
    made = {
        "auto": work.averaged,
        "emulated": work.emulated,
        "distilled": work.distilled,
        "mdrff": work.network,
        "plain": work.network,
    }[config.method]()
    seconds = time.process_time() - started
    return replace(made, summary=replace(made.summary, fit_seconds=seconds))


class _Work:
    def __init__(
        self,
        pairs: TrainingPairs,
        config: Config,
        seed: int,
        proposal: Prior | None,
        progress: Callable[[Progress], None] | None,
    ) -> None:
        self.pairs, self.config, self.seed, self.progress = pairs, config, seed, progress
        self.prior = pairs.prior
        self.u = self.prior.to_unconstrained(pairs.theta)
        self.standardiser = Standardiser.fit(pairs.x)
        self.z = self.standardiser.apply(pairs.x)
        self.weights = importance_weights(pairs, proposal)
        order = np.random.default_rng(seed).permutation(len(self.u))
        self.material = material_of(self.u)
        sides = split(order, self.material, _test_count(len(order), config.test_share))
        self.test, self.rest = (in_turns(rows, self.material) for rows in sides)

    def emulated(self) -> Trained:
        """The emulator's posterior; every pair is used, and checked by a fit without it."""
        likelihood, folds, choice = self._likelihood(np.arange(len(self.u)))
        return self._by_emulator(likelihood, folds, choice)

    def distilled(self) -> Trained:
        """A network that imitates the emulator's posterior."""
        likelihood, _, choice = self._likelihood(self.rest)
        amortised, result = Amortised.distil(
            likelihood, self.prior, config=self.config, seed=self.seed, progress=self.progress
        )
        return self._by_network(likelihood, amortised, result, f"imitates an emulator: {choice}")

    def network(self) -> Trained:
        """A network trained on the pairs."""
        amortised, result = self._network()
        likelihood = self._likelihood(self.rest)[0]
        return self._by_network(likelihood, amortised, result, "network on the statistics")

    def averaged(self) -> Trained:
        """Emulator and network, averaged with the weights that say most about held-out pairs."""
        order = np.concatenate([self.test, self.rest])
        likelihood, folds, choice = self._likelihood(np.arange(len(self.u)), order)
        # A network of few pairs of the prior is too narrow, and as few cannot tell.
        if len(self.test) == 0 or self._few_of_the_prior is not None:
            return self._by_emulator(likelihood, folds, choice)
        amortised, result = self._network()
        # The same pairs for both: those kept aside from the network are held out by the folds too.
        unseen = [(fold, fold.held[np.isin(fold.held, self.test)]) for fold in folds]
        rows = np.concatenate([rows for _, rows in unseen])
        owners = [fold.likelihood for fold, rows in unseen for _ in rows]
        mixtures = amortised.mixtures(self.z[rows])
        held_out = self._held_out(unseen, mixtures)
        average = held_out.choose()
        alone = [held_out.gain(one) for one in (EMULATOR_ALONE, NETWORK_ALONE)]
        told = f"on {len(rows)} pairs unseen by both: emulator {alone[0]:.2f}"
        told += f", network {alone[1]:.2f} nat above the prior"
        if average == NETWORK_ALONE:
            told = f"network alone\n  emulator: {choice}\n  {told}"
            made = self._by_network(likelihood, amortised, result, told)
            return replace(made, chose_form=True)
        if average == EMULATOR_ALONE:
            made = self._by_emulator(likelihood, folds, choice)
            told = f"{made.summary.choice}\n  {told}: the emulator alone"
            return replace(made, summary=replace(made.summary, choice=told))
        chosen = self._of_the_prior(rows)
        posteriors = [
            Posterior.from_average(
                self.prior, (owners[i], self.z[rows[i]][None]), [mixtures[i]], average
            )
            for i in chosen
        ]
        told += f", {average} {held_out.gain(average):.2f}"
        choice_text = f"average of an emulator and a network\n  emulator: {choice}\n  {told}"
        summary = self._summary("averaged", choice_text, result, len(self.rest), len(chosen))
        return Trained(
            self.standardiser,
            likelihood,
            amortised,
            average,
            self.misfit,
            summary,
            posteriors,
            self.pairs.theta[rows[chosen]],
            chose_form=True,
        )

    def _held_out(
        self, unseen: list[tuple[Fold, NDArray[np.intp]]], mixtures: list[Mixture]
    ) -> HeldOut:
        """What both say of pairs that the folds leave out; `mixtures` in the order of the rows."""
        ends = np.cumsum([len(rows) for _, rows in unseen])
        parts = [
            HeldOut.of(fold, mixtures[end - len(rows) : end], self.u[rows], self.z[rows])
            for (fold, rows), end in zip(unseen, ends, strict=True)
            if len(rows)
        ]
        return HeldOut.joined(parts)

    def _likelihood(
        self, rows: NDArray[np.intp], order: NDArray[np.intp] | None = None
    ) -> tuple[Likelihood, list[Fold], EmulatorChoice]:
        u, z, prior = self.u[rows], self.z[rows], self.prior
        found = Likelihood.fit(
            u, z, prior, features=self.config.emulator_features, seed=self.seed, order=order
        )
        self.misfit = MisfitReference.of(found[1], u, z)
        return found

    def _network(self) -> tuple[Amortised, TrainingResult]:
        return Amortised.fit(
            self.u[self.rest],
            self.z[self.rest],
            config=self.config,
            seed=self.seed,
            weights=None if self.weights is None else self.weights[self.rest],
            progress=self.progress,
        )

    def _by_emulator(
        self, likelihood: Likelihood, folds: list[Fold], choice: EmulatorChoice
    ) -> Trained:
        rows = np.concatenate([fold.held for fold in folds])
        owners = [fold.likelihood for fold in folds for _ in fold.held]
        chosen = self._of_the_prior(rows)
        posteriors = [
            Posterior.from_conditions(self.prior, [(owners[i], self.z[rows[i]][None])])
            for i in chosen
        ]
        count = len(self.u)
        summary = self._summary("emulated", f"emulator: {choice}", None, count, len(chosen))
        return Trained(
            self.standardiser,
            likelihood,
            None,
            EMULATOR_ALONE,
            self.misfit,
            summary,
            posteriors,
            self.pairs.theta[rows[chosen]],
            chose_form=True,
        )

    def _by_network(
        self, likelihood: Likelihood, amortised: Amortised, result: TrainingResult, choice: str
    ) -> Trained:
        rows = self.test[self._of_the_prior(self.test)]
        mixtures = amortised.mixtures(self.z[rows]) if len(rows) else []
        posteriors = [Posterior.from_mixture(self.prior, mixture) for mixture in mixtures]
        method = "mdrff" if self.config.method == "auto" else self.config.method
        summary = self._summary(method, choice, result, len(self.rest), len(rows))
        return Trained(
            self.standardiser,
            likelihood,
            amortised,
            NETWORK_ALONE,
            self.misfit,
            summary,
            posteriors,
            self.pairs.theta[rows],
            chose_form=False,
        )

    def _of_the_prior(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Indices of `rows` as if they were drawn from the prior, one of each material."""
        # Each once at most: a truth that is drawn twice is one truth, and no evidence of two.
        alone = firsts(self.material[rows])
        if self.weights is None or len(rows) == 0:
            return alone
        share = self.weights[rows] / self.weights[rows].max()
        kept = np.random.default_rng(self.seed).random(len(rows)) < share
        return alone[kept[alone]]

    def _notes(self) -> tuple[str, ...]:
        """What is odd about the statistics."""
        names, apart = self.pairs.x_names, np.abs(self.z).max(axis=0)
        is_constant = self.standardiser.is_constant
        constant = [name for name, c in zip(names, is_constant, strict=True) if c]
        far = [
            f"{name} ({size:.0f} sd)"
            for name, size in zip(names, apart, strict=True)
            if size > _FAR * np.sqrt(len(self.z))
        ]
        notes = [f"never changed in training: {', '.join(constant)}"] if constant else []
        if lacking := self.pairs.without_value:
            told = ", ".join(f"{name} ({count})" for name, count in lacking.items())
            notes.append(
                f"left out for having no value of {told}: where these pours lie in the prior "
                "nothing is learnt and nothing checked; observe what every pour has"
            )
        if far:
            notes.append(
                f"one pair has nearly all of the spread of {', '.join(far)}: is it a pour at all?"
            )
        if self.weights is None and self.pairs.not_of_prior:
            notes.append(told_not_of_prior(self.pairs))
        if (worth := self._few_of_the_prior) is not None:
            notes.append(
                f"the {len(self.z)} pairs of the proposal are worth {worth:.0f} of the prior, at "
                f"least {_FEWEST_OF_PRIOR} are wanted: posteriors may be too narrow; a prior or a "
                "proposal nearer to each other helps"
            )
        return tuple(notes)

    @property
    def _few_of_the_prior(self) -> float | None:
        """How many pairs of the prior those of a proposal are worth, if too few."""
        if self.weights is None:
            return None
        worth = float(np.sum(self.weights) ** 2 / np.sum(self.weights**2))
        return worth if worth < min(_FEWEST_OF_PRIOR, 0.5 * len(self.weights)) else None

    def _summary(
        self, method: str, choice: str, result: TrainingResult | None, train: int, test: int
    ) -> TrainingSummary:
        pairs = self.pairs
        summary = TrainingSummary(
            method=method,
            choice=choice,
            pair_count=pairs.pair_count,
            train_count=train,
            test_count=test,
            excluded=pairs.excluded,
            horizon_count=pairs.horizon_count,
            notes=self._notes(),
        )
        if result is None:
            return summary
        return replace(
            summary,
            status=result.status,
            train_count=result.train_count,
            validation_count=result.validation_count,
            epoch_count=result.epoch_count,
            best_epochs=result.best_epochs,
            train_losses=result.train_losses,
            validation_losses=result.validation_losses,
            curve=result.curve,
        )


def told_not_of_prior(pairs: TrainingPairs) -> str:
    """Returns in words which parameters do not look drawn from the prior, and what helps."""
    found = ", ".join(f"{name} (p = {p:.1g})" for name, p in pairs.not_of_prior.items())
    return (
        f"not drawn from the prior, it seems: {found}; no check against this prior holds then. Say "
        "proposal= what they were drawn from, and give rows that were left out with their status"
    )


def importance_weights(pairs: TrainingPairs, proposal: Prior | None) -> Array | None:
    """Returns p(theta) / proposal(theta) of each pair over their mean, shape (n,).

    Raises:
        TrainingDataError: the proposal has other parameters, fixes one elsewhere, cannot have made
            the pairs, or has none where more than a hundredth of the prior is.
    """
    if proposal is None:
        return None
    if proposal.names != pairs.prior.names:
        raise TrainingDataError(
            f"proposal must have the prior's parameters {pairs.prior.names}, got {proposal.names}"
        )
    _require_same_fixed(pairs, proposal)
    _require_covered(pairs.prior, proposal)
    log_weights = pairs.prior.log_prob(pairs.theta) - proposal.log_prob(pairs.theta)
    if not np.all(np.isfinite(log_weights)):
        count = int(np.sum(~np.isfinite(log_weights)))
        raise TrainingDataError(f"{count} rows of theta are outside the proposal's bounds")
    weights = np.exp(log_weights - log_weights.max())
    return weights / weights.mean()


def _require_same_fixed(pairs: TrainingPairs, proposal: Prior) -> None:
    """Refuses pairs of another material than the prior's: no weight makes them its own."""
    own = pairs.prior.fixed
    for name, value in proposal.fixed.items():
        if own.get(name) != value:
            here = f"at {own[name]}" if name in own else "nowhere"
            raise TrainingDataError(
                f"proposal fixes {name} at {value}, the prior {here}: the pairs are of that value"
            )
    if pairs.scene_toml is None:
        return
    # What a proposal does not name is the scene's.
    scene = Scene.from_toml(pairs.scene_toml)
    for name, value in own.items():
        if name not in proposal.fixed and scene.has(name) and scene.get(name) != value:
            raise TrainingDataError(
                f"the prior fixes {name} at {value}, the proposal nowhere: the pairs are of the "
                f"scene's {scene.get(name)}"
            )


def _require_covered(prior: Prior, proposal: Prior) -> None:
    """Refuses a proposal without pairs in a part of the prior: no weight stands for what is not."""
    low, high = prior.cdf(proposal.bounds.T)
    for name, left, bounds in zip(prior.names, low + 1 - high, proposal.bounds, strict=True):
        if left > _LARGEST_UNCOVERED:
            raise TrainingDataError(
                f"proposal has {name} from {bounds[0]:g} to {bounds[1]:g} only, and {left:.0%} of "
                "the prior lies beyond: nothing is learnt there; a prior within the proposal, or "
                "pours of the rest, are needed"
            )


def _test_count(pair_count: int, share: float) -> int:
    count = round(share * pair_count)
    if share > 0 and pair_count >= _PAIRS_FOR_A_WORTHWHILE_TEST:
        count = max(count, _WORTHWHILE_TEST_PAIRS)
    return count
