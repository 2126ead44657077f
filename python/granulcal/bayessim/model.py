"""BayesSim: train once on simulated pairs, then a posterior for any observation."""

from __future__ import annotations

import hashlib
import sys
import warnings
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.arrays import as_real
from granulcal.bayessim.check.calibration import Calibration
from granulcal.bayessim.check.identifiability import Identifiability
from granulcal.bayessim.check.misfit import Misfit, MisfitReference
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.named import by_name
from granulcal.bayessim.network.amortised import Amortised
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.network.trainer import Progress
from granulcal.bayessim.posterior.average import Average
from granulcal.bayessim.posterior.doubts import out_of_range
from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.bayessim.replicates import firsts, material_of
from granulcal.bayessim.storage.model_folder import load_parts, save_model
from granulcal.bayessim.training.config import Config
from granulcal.bayessim.training.fit import told_not_of_prior, train_model
from granulcal.bayessim.training.pairs import TrainingPairs, require_same_prior
from granulcal.bayessim.training.summary import TrainingSummary
from granulcal.errors import NotOfPriorWarning, ObservationError, TrainingDataError
from granulcal.one_thread import one_thread
from granulcal.prior import Prior
from granulcal.progress import shown, steps
from granulcal.starter.models import is_built_in, model_named
from granulcal.whole import check_seed, check_whole

__all__ = ["BayesSim"]

Array = NDArray[np.float64]

# Below ten test pairs a coverage says nothing.
FEWEST_TO_CHECK = 10
_CHECK_DRAWS = 1000


class BayesSim:
    """Posterior of a simulator's parameters from statistics.

    Made by `fit` or `load`.

    Attributes:
        prior: the prior that the model was trained under.
        config: settings of the training.
        x_names: names of the statistics.
        standardiser: what brings statistics to spread 1.
        likelihood: the emulator of the statistics.
        amortised: the network, or None if the posterior is that of the emulator alone.
        average: how much both count in the posterior of one pour.
        summary: what the training did, with every excluded pair counted.
        misfit_reference: residuals that an observation of a right model can have.
        calibration: check on pairs, each by a fit without it, or None if there were too few.
        identifiability: what an observation tells on average, or None likewise.
        scene_toml: the scene of the training data, or None.
        law: number of the solver's law that the training's pours follow; 0 for another simulator,
            None where nobody knows.

    Reference:
        Ramos, Possas and Fox, BayesSim: adaptive domain randomization via probabilistic inference
        for robotics simulators, RSS 2019, arXiv:1906.01728.

    Examples:
        >>> from granulcal.bayessim.check.toys import LinearGaussian
        >>> toy = LinearGaussian.random()
        >>> theta, x = toy.simulate(200)
        >>> model = BayesSim.fit(theta, x, toy.prior, quiet=True, method="emulated")
        >>> model.posterior(x[0]).sample(10).shape
        (10, 3)
    """

    def __init__(
        self,
        *,
        prior: Prior,
        config: Config,
        standardiser: Standardiser,
        likelihood: Likelihood,
        amortised: Amortised | None,
        average: Average,
        x_names: tuple[str, ...],
        misfit_reference: MisfitReference,
        summary: TrainingSummary,
        calibration: Calibration | None = None,
        identifiability: Identifiability | None = None,
        scene_toml: str | None = None,
        law: int | None = None,
    ) -> None:
        """Joins the parts of a trained model; use `fit` or `load`."""
        self.prior = prior
        self.config = config
        self.standardiser = standardiser
        self.likelihood = likelihood
        self.amortised = amortised
        self.average = average
        self.x_names = x_names
        self.summary = summary
        self.misfit_reference = misfit_reference
        self.calibration = calibration
        self.identifiability = identifiability
        self.scene_toml = scene_toml
        self.law = law

    @classmethod
    @one_thread()
    def fit(
        cls,
        data_or_theta: Any,
        x: Any = None,
        prior: Prior | None = None,
        seed: int = 0,
        *,
        status: Sequence[str] | None = None,
        x_names: Sequence[str] | None = None,
        scene: Any = None,
        proposal: Prior | None = None,
        quiet: bool = False,
        progress: Callable[[Progress], None] | None = None,
        **config: Any,
    ) -> BayesSim:
        """Returns a model trained on pairs; prints a summary and a calibration check.

        The same pairs, seed and settings give the same model, whatever the number of threads. In a
        terminal a line on stderr shows how far it is, unless `quiet`.

        Args:
            data_or_theta: a data set with attributes theta (n, p), theta_names, x (n, s), status
                and prior; or parameters in own units, shape (n, p). The columns of a data frame
                are matched with the prior's names.
            x: statistics, own units, shape (n, s), if the first argument is an array.
            prior: the prior that the parameters were drawn from, unless the data set has it;
                another than the data set's needs `proposal`.
            seed: seed of every random choice.
            status: status of each pour; `unhealthy`, `jammed` and `no_grains_in_view` are excluded.
            x_names: names of the statistics; those of the columns if `x` is a data frame.
            scene: scene of the pours, saved with the model: TOML text, or has `to_toml()`.
            proposal: what the parameters were drawn from, if it was not the prior; the pairs are
                weighted then, and those outside of the prior are left out. It reaches wherever the
                prior does.
            quiet: print nothing.
            progress: called after each pass over the pairs.
            **config: settings of `Config`, for example `method="plain"` or `components=10`.

        Raises:
            TrainingDataError: pairs that cannot be trained on; the message says why.
            TypeError: a seed that is no whole number, or a scene that is no text.
            ValueError: a setting that does not exist or has an impossible value.

        Warns:
            NotOfPriorWarning: the parameters do not look drawn from the prior, and no proposal is
                stated.
        """
        settings = Config.from_options(**config)
        check_seed(seed)
        if x is None and proposal is None:
            require_same_prior(getattr(data_or_theta, "prior", None), prior)
        pairs = TrainingPairs.gather(
            data_or_theta,
            x,
            prior=prior,
            status=status,
            x_names=x_names,
            scene=scene,
            proposal=proposal,
        )
        pairs.require_varied()
        if proposal is None and pairs.not_of_prior:
            # Past the two frames of the decorator.
            warnings.warn(told_not_of_prior(pairs), NotOfPriorWarning, stacklevel=3)
        with nullcontext() if quiet or not _is_watched() else shown():
            model = cls._of_pairs(pairs, settings, int(seed), proposal, progress)
        if not quiet:
            print(model.summary)
            few = "too few pours to keep some aside"
            if proposal is not None:
                few = "too few of the pours kept aside count as draws of the prior"
            unchecked = f"  calibration not checked: {few}"
            print(unchecked if model.calibration is None else model.calibration)
            if model.identifiability is not None:
                print(model.identifiability)
        return model

    @classmethod
    def _of_pairs(
        cls,
        pairs: TrainingPairs,
        settings: Config,
        seed: int,
        proposal: Prior | None,
        progress: Callable[[Progress], None] | None,
    ) -> BayesSim:
        """Trains and checks."""
        made = train_model(pairs, settings, seed, proposal=proposal, progress=progress)
        kept = settings.component_counts[0]
        if made.amortised is not None:
            kept = made.amortised.network.layout.components
        enough = len(made.posteriors) >= FEWEST_TO_CHECK
        return cls(
            prior=pairs.prior,
            config=replace(settings, components=kept),
            standardiser=made.standardiser,
            likelihood=made.likelihood,
            amortised=made.amortised,
            average=made.average,
            x_names=pairs.x_names,
            misfit_reference=made.misfit,
            summary=made.summary,
            calibration=Calibration.of(
                pairs.prior,
                made.posteriors,
                made.truth,
                draw_count=_CHECK_DRAWS,
                chose_form=made.chose_form,
            )
            if enough
            else None,
            identifiability=Identifiability.average(made.posteriors, made.truth)
            if enough
            else None,
            scene_toml=pairs.scene_toml,
            law=pairs.law,
        )

    @property
    def scene_hash(self) -> str | None:
        """SHA-256 of the scene's TOML text, or None without a scene."""
        if self.scene_toml is None:
            return None
        return hashlib.sha256(self.scene_toml.encode()).hexdigest()

    @one_thread()
    def posterior(self, x_obs: Any) -> Posterior:
        """Returns the posterior given one observation, or several of one material.

        What carries names is matched with `x_names`, and may have others: statistics, a dict, a
        series, a data frame, or a list of such. Plain numbers are taken in the order of `x_names`.

        Ask `misfit` first: a posterior comes out whether or not any parameters explain the
        observation, and is of no use if none do.

        Several pours share their parameters. Under the emulator they have one likelihood, in which
        what differs between them averages away and the emulator's own error does not. A network's
        posteriors of several pours together count as much as one does for one pour, alone and in
        the average with an emulator: their error is the same in all, and multiplied with itself it
        would be taken for knowledge.

        Args:
            x_obs: statistics, own units, shape (s,) for one pour or (k, s) for k pours.

        Raises:
            ObservationError: another shape, other names, or a statistic that is not finite.
        """
        observed = self._checked(x_obs)
        warnings = out_of_range(self.standardiser, observed, self.x_names)
        z = self.standardiser.apply(observed)
        condition = self.likelihood, z
        if self.amortised is None:
            return Posterior.from_conditions(self.prior, [condition], warnings=warnings)
        mixtures = self.amortised.mixtures(z)
        return Posterior.from_average(
            self.prior, condition, mixtures, self.average, warnings=warnings
        )

    @one_thread()
    def misfit(self, x_obs: Any) -> Misfit:
        """Returns whether any parameters explain one observation, or several of one material.

        Ask this before the posterior: it answers under the model, right or wrong. Names are matched
        as there.

        Args:
            x_obs: statistics, own units, shape (s,) for one pour or (k, s) for k pours.

        Raises:
            ObservationError: another shape, other names, or a statistic that is not finite.
        """
        z = self.standardiser.apply(self._checked(x_obs), clip=False)
        return self.misfit_reference.test(self.likelihood, z, self.x_names)

    def check(self, theta: Any, x: Any, *, draw_count: int = 1000) -> Calibration:
        """Returns the calibration on pairs, which must not have been trained on.

        Args:
            theta: true parameters drawn from the prior, own units, shape (n, p).
            x: their statistics, own units, shape (n, s).
            draw_count: draws of each posterior, at least 1.

        Raises:
            TrainingDataError: pairs that cannot be checked with; the message says why.
            TypeError: `draw_count` is no whole number.
            ValueError: it is less than 1.
        """
        return self.examine(theta, x, draw_count=draw_count)[0]

    @one_thread()
    def examine(
        self, theta: Any, x: Any, *, draw_count: int = 1000
    ) -> tuple[Calibration, Identifiability]:
        """Returns the calibration on pairs and what their statistics tell on average.

        Both are of the same posteriors, one for each pair; of several pairs of the same parameters
        the first counts. Arguments and errors are those of `check`.
        """
        check_whole("draw_count", draw_count, at_least=1)
        x = by_name("x", x, self.x_names, whose="the model", error=TrainingDataError)
        pairs = TrainingPairs.gather(
            theta, x, prior=self.prior, x_names=self.x_names, fewest=FEWEST_TO_CHECK
        )
        # Several pours of one material are one truth: counted each they fail right posteriors.
        alone = firsts(material_of(pairs.theta))
        if len(alone) < FEWEST_TO_CHECK:
            raise TrainingDataError(
                f"at least {FEWEST_TO_CHECK} usable pairs of different parameters are needed, got "
                f"{len(alone)}"
            )
        truth, observed = pairs.theta[alone], pairs.x[alone]
        posteriors = [self.posterior(row) for row in steps("posteriors", list(observed))]
        known = Identifiability.average(posteriors, truth)
        return Calibration.of(self.prior, posteriors, truth, draw_count=draw_count), known

    def save(self, path: str | PathLike[str], *, compact: bool = False) -> None:
        """Writes the folder `path`: model.json and weights.safetensors, all or nothing.

        Args:
            path: a folder that is new, empty, or a model.
            compact: without tables that are worked out again in the first posterior's second.
        """
        save_model(self, path, compact=compact)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> BayesSim:
        """Returns the model that `save` wrote to the folder `path`, equal to the last bit.

        Args:
            path: folder of a model, or the name of a built-in scene (`funnel` or `drop`): the model
                that `granulcal model` made of it, or that came with the package.

        Raises:
            FileNotFoundError: the folder or one of its files does not exist, or there is no model
                of the built-in scene yet.
            ModelFormatError: the files are there but cannot be this model; the message says why.
        """
        return cls(**load_parts(model_named(path) if is_built_in(path) else path))

    def __reduce__(self) -> tuple[Any, ...]:
        # What the extension holds is made again from the files: a model goes to another process so.
        with TemporaryDirectory() as folder:
            path = Path(folder) / "model"
            self.save(path)
            files = {each.name: each.read_bytes() for each in path.iterdir()}
        return _of_files, (files,)

    def __repr__(self) -> str:
        names, statistics = ", ".join(self.prior.names), len(self.x_names)
        return f"BayesSim({names} of {statistics} statistics, {self.summary.pair_count} pours)"

    def _checked(self, x_obs: Any) -> Array:
        named = by_name(
            "x_obs",
            x_obs,
            self.x_names,
            whose="the model",
            error=ObservationError,
            may_have_more=True,
        )
        observed = as_real("x_obs", named)
        count = len(self.x_names)
        rows = observed[None] if observed.ndim == 1 else observed
        if rows.ndim != 2 or rows.shape[1] != count or len(rows) == 0:
            raise ObservationError(
                f"x_obs must have shape ({count},) or (k, {count}), got {observed.shape}"
            )
        bad = ~np.isfinite(rows)
        if bad.any():
            names = [self.x_names[i] for i in np.flatnonzero(bad.any(axis=0))]
            raise ObservationError(f"x_obs must be finite, it is not in {', '.join(names)}")
        return rows


def _is_watched() -> bool:
    # There is none in a program without a console.
    return sys.stderr is not None and sys.stderr.isatty()


def _of_files(files: dict[str, bytes]) -> BayesSim:
    """Returns the model of a folder's files."""
    with TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        return BayesSim.load(folder)
