"""BayesSim: train once on simulated pairs, then a posterior for any observation."""

import hashlib
import time
from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.bayessim.arrays import as_real
from granulcal.bayessim.config import Config
from granulcal.bayessim.mixture import Mixture
from granulcal.bayessim.network import Network
from granulcal.bayessim.pairs import TrainingPairs
from granulcal.bayessim.signal import SignalAxes
from granulcal.bayessim.standardise import Standardiser
from granulcal.bayessim.summary import Calibration, TrainingSummary
from granulcal.bayessim.trainer import Progress, train
from granulcal.diagnostics import expected_coverage
from granulcal.errors import ObservationError
from granulcal.posterior import OutOfRange, Posterior
from granulcal.prior import Prior

__all__ = ["BayesSim"]

Array = NDArray[np.float64]

# Below ten test pairs a coverage says nothing; from 300 pairs on, at least 50 are spared for it.
_FEWEST_TEST_PAIRS = 10
_WORTHWHILE_TEST_PAIRS = 50
_PAIRS_FOR_A_WORTHWHILE_TEST = 300


class BayesSim:
    """Posterior of a simulator's parameters from statistics, by a mixture density network.

    Made by `fit` or `load`.

    Attributes:
        prior: the prior that the model was trained under.
        config: settings of the training.
        x_names: names of the statistics.
        summary: what the training did, with every excluded pair counted.
        calibration: check on pairs that were not trained on, or None if there were too few.
        scene_toml: the scene of the training data, or None.

    Reference:
        Ramos, Possas and Fox, BayesSim: adaptive domain randomization via probabilistic inference
        for robotics simulators, RSS 2019, arXiv:1906.01728.

    Example:
        >>> from granulcal.toys import LinearGaussian
        >>> toy = LinearGaussian.random()
        >>> theta, x = toy.simulate(200)
        >>> model = BayesSim.fit(theta, x, toy.prior, quiet=True, max_epochs=5)
        >>> model.posterior(x[0]).sample(10).shape
        (10, 3)
    """

    def __init__(
        self,
        *,
        prior: Prior,
        config: Config,
        network: Network,
        standardiser: Standardiser,
        axes: SignalAxes,
        target_shift: Array,
        target_scale: Array,
        x_names: tuple[str, ...],
        summary: TrainingSummary,
        calibration: Calibration | None = None,
        scene_toml: str | None = None,
    ) -> None:
        """Joins the parts of a trained model; use `fit` or `load`."""
        self.prior = prior
        self.config = config
        self.network = network
        self.standardiser = standardiser
        self.axes = axes
        self.target_shift = target_shift
        self.target_scale = target_scale
        self.x_names = x_names
        self.summary = summary
        self.calibration = calibration
        self.scene_toml = scene_toml

    @classmethod
    def fit(
        cls,
        data_or_theta: Any,
        x: ArrayLike | None = None,
        prior: Prior | None = None,
        seed: int = 0,
        *,
        status: Sequence[str] | None = None,
        x_names: Sequence[str] | None = None,
        scene: Any = None,
        quiet: bool = False,
        progress: Callable[[Progress], None] | None = None,
        **config: Any,
    ) -> "BayesSim":
        """Returns a model trained on pairs; prints a summary and a calibration check.

        The same pairs, seed and settings give the same model, whatever the number of threads.

        Args:
            data_or_theta: a data set with attributes theta (n, p), theta_names, x (n, s), status
                and prior; or parameters in own units, shape (n, p).
            x: statistics, own units, shape (n, s), if the first argument is an array.
            prior: the prior that the parameters were drawn from, unless the data set has it.
            seed: seed of every random choice.
            status: status of each pour; `unhealthy`, `jammed` and `no_grains_in_view` are excluded.
            x_names: names of the statistics.
            scene: scene of the pours, saved with the model: TOML text, or has `to_toml()`.
            quiet: print nothing.
            progress: called after each pass over the pairs.
            **config: settings of `Config`, for example `recipe="plain"` or `components=10`.

        Raises:
            TrainingDataError: pairs that cannot be trained on; the message says why.
            ValueError: a setting that does not exist or has an impossible value.
        """
        settings = Config.from_options(**config)
        if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
            raise ValueError(f"seed must be a whole number of at least 0, got {seed!r}")
        pairs = TrainingPairs.gather(
            data_or_theta, x, prior=prior, status=status, x_names=x_names, scene=scene
        )
        model, test = cls._train(pairs, settings, int(seed), progress)
        if len(test) >= _FEWEST_TEST_PAIRS:
            model.calibration = model.check(pairs.theta[test], pairs.x[test])
        if not quiet:
            print(model.summary)
            unchecked = f"  calibration not checked: {len(test)} test pairs only"
            print(unchecked if model.calibration is None else model.calibration)
        return model

    @classmethod
    def _train(
        cls,
        pairs: TrainingPairs,
        config: Config,
        seed: int,
        progress: Callable[[Progress], None] | None,
    ) -> tuple["BayesSim", NDArray[np.intp]]:
        started = time.process_time()
        order = np.random.default_rng(seed).permutation(len(pairs.theta))
        test, rest = np.split(order, [_test_count(len(order), config.test_share)])
        u = pairs.prior.to_unconstrained(pairs.theta[rest])
        shift, scale = u.mean(axis=0), u.std(axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        standardiser = Standardiser.fit(pairs.x[rest])
        z = standardiser.apply(pairs.x[rest])
        targets = (u - shift) / scale
        axes = SignalAxes.fit(targets, z) if config.snr else SignalAxes.identity(z.shape[1])
        result = train(
            targets, axes.apply(z), axes.relevance, config=config, seed=seed, progress=progress
        )
        constant = [n for n, c in zip(pairs.x_names, standardiser.is_constant, strict=True) if c]
        summary = TrainingSummary(
            status=result.status,
            pair_count=pairs.pair_count,
            train_count=result.train_count,
            validation_count=result.validation_count,
            test_count=len(test),
            excluded=pairs.excluded,
            horizon_count=pairs.horizon_count,
            epoch_count=result.epoch_count,
            best_epochs=result.best_epochs,
            train_losses=result.train_losses,
            validation_losses=result.validation_losses,
            fit_seconds=time.process_time() - started,
            notes=(f"never changed in training: {', '.join(constant)}",) if constant else (),
        )
        model = cls(
            prior=pairs.prior,
            config=config,
            network=result.network,
            standardiser=standardiser,
            axes=axes,
            target_shift=shift,
            target_scale=scale,
            x_names=pairs.x_names,
            summary=summary,
            scene_toml=pairs.scene_toml,
        )
        return model, test

    @property
    def scene_hash(self) -> str | None:
        """SHA-256 of the scene's TOML text, or None without a scene."""
        if self.scene_toml is None:
            return None
        return hashlib.sha256(self.scene_toml.encode()).hexdigest()

    def posterior(self, x_obs: ArrayLike) -> Posterior:
        """Returns the posterior given one observation, or several of one material.

        Several pours share their parameters, so their posteriors are multiplied and the prior
        divided out k - 1 times; this is not an average, and it narrows as k grows. Errors of the
        network are multiplied too: trust k pours no more than the calibration of one allows.

        Args:
            x_obs: statistics, own units, shape (s,) for one pour or (k, s) for k pours.

        Raises:
            ObservationError: another shape, or a statistic that is not finite.
        """
        observed = self._checked(x_obs)
        return Posterior.from_mixtures(
            self.prior, self._mixtures(observed), warnings=self._range_warnings(observed)
        )

    def check(self, theta: ArrayLike, x: ArrayLike, *, draw_count: int = 1000) -> Calibration:
        """Returns the calibration on pairs, which must not have been trained on.

        Args:
            theta: true parameters drawn from the prior, own units, shape (n, p).
            x: their statistics, own units, shape (n, s).
            draw_count: draws of each posterior.
        """
        truth = as_real("theta", theta)
        mixtures = self._mixtures(self._checked(x))
        posteriors = [Posterior.from_mixture(self.prior, mixture) for mixture in mixtures]
        densities = [p.log_prob(t)[0] for p, t in zip(posteriors, truth, strict=True)]
        return Calibration(
            test_count=len(truth),
            posterior_loss=float(-np.mean(densities)),
            prior_loss=float(-np.mean(self.prior.log_prob(truth))),
            coverage=expected_coverage(posteriors, truth, draw_count=draw_count).counts,
        )

    def save(self, path: str | PathLike[str]) -> None:
        """Writes the folder `path`: model.json and weights.safetensors, all or nothing."""
        from granulcal.bayessim.storage import save_model

        save_model(self, path)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "BayesSim":
        """Returns the model that `save` wrote to the folder `path`, equal to the last bit.

        Raises:
            FileNotFoundError: the folder or one of its files does not exist.
            ModelFormatError: the files are there but cannot be this model; the message says why.
        """
        from granulcal.bayessim.storage import load_model

        return load_model(path)

    def _mixtures(self, x: Array) -> list[Mixture]:
        """One mixture over the prior's coordinates for each row of `x` (n, s)."""
        inputs = self.axes.apply(self.standardiser.apply(x))
        return [
            Mixture(
                mixture.weights,
                self.target_shift + self.target_scale * mixture.means,
                mixture.factors / self.target_scale[:, None],
            )
            for mixture in self.network.mixtures(inputs)
        ]

    def _checked(self, x_obs: ArrayLike) -> Array:
        observed = as_real("x_obs", x_obs)
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

    def _range_warnings(self, observed: Array) -> tuple[OutOfRange, ...]:
        found = []
        low, high = self.standardiser.low, self.standardiser.high
        for pour, outside in enumerate(self.standardiser.is_outside(observed)):
            where = np.flatnonzero(outside)
            if len(where):
                found.append(
                    OutOfRange(
                        pour,
                        tuple(self.x_names[i] for i in where),
                        tuple(float(observed[pour, i]) for i in where),
                        tuple((float(low[i]), float(high[i])) for i in where),
                    )
                )
        return tuple(found)


def _test_count(pair_count: int, share: float) -> int:
    count = round(share * pair_count)
    if share > 0 and pair_count >= _PAIRS_FOR_A_WORTHWHILE_TEST:
        count = max(count, _WORTHWHILE_TEST_PAIRS)
    return count
