"""Settings of a training run; they check themselves."""

from dataclasses import asdict, dataclass, fields
from typing import Any

__all__ = ["Config"]

KERNELS = ("matern12", "matern32", "matern52", "rbf")
METHODS = ("auto", "emulated", "distilled", "mdrff", "plain")
# The recipe of Ramos, Possas & Fox (2019) apart from z-scoring and early stopping.
_PLAIN = {"linear_start": False, "snr": False, "jitter": 0.0, "ensemble": 1, "weight_decay": 0.0}

# Synthetic pairs have no end: large batches and steps, nothing that guards against too few pairs.
_DISTILLED = {
    "jitter": 0.0,
    "ensemble": 1,
    "weight_decay": 0.0,
    "batch_size": 256,
    "learning_rate": 3e-3,
    "max_epochs": 40,
}
_DEFAULTS = {"plain": _PLAIN, "distilled": _DISTILLED}


@dataclass(frozen=True, kw_only=True)
class Config:
    """How a mixture density random feature network is built and trained.

    Attributes:
        method: `emulated`: likelihood of an emulator of the statistics. `mdrff`: network trained on
            the pairs. `auto`, the default: both, averaged with the weights that say most about
            held-out pairs. `distilled`: network trained on synthetic pairs of the emulator.
            `plain`: the original recipe of the network. The last two only change the network's
            defaults.
        kernel: kernel whose spectrum the frequencies are drawn from.
        features: number of random frequencies; each gives a cosine and a sine.
        components: Gaussians in the mixture of one member; where several numbers are given, each is
            trained, and the one of the best validation loss is kept.
        ensemble: networks whose densities are averaged.
        length_scale: factor on the median distance between training inputs.
        snr: whether each statistic's frequency is scaled by its explained share of variance.
        linear_start: whether training starts from the linear regression of the parameters on the
            statistics instead of from nothing.
        jitter: standard deviation of the noise added to the standardised inputs in training; in
            inverse proportion less where there are more than 1500 pairs.
        learning_rate: first step of Adam; it falls to zero along a cosine.
        batch_size: pairs per step; a hundredth of the pairs, if that is more.
        max_epochs: passes over the pairs at most; fewer from 1500 pairs on.
        patience: passes without a better validation loss before a member stops.
        validation_share: share of the pairs that only decide when to stop.
        test_share: share of the pairs that no network is trained on, to check and weigh it by.
        synthetic: synthetic pairs of `distilled`.
        emulator_features: random frequencies of the emulator.
        weight_decay: decoupled decay of the weights on the random features (AdamW).
    """

    method: str = "auto"
    kernel: str = "matern52"
    features: int = 250
    components: int | tuple[int, ...] = 5
    ensemble: int = 5
    length_scale: float = 1.0
    snr: bool = True
    linear_start: bool = True
    jitter: float = 0.05
    learning_rate: float = 1e-3
    batch_size: int = 32
    max_epochs: int = 400
    patience: int = 40
    validation_share: float = 0.1
    test_share: float = 0.1
    weight_decay: float = 0.3
    synthetic: int = 20_000
    emulator_features: int = 100

    def __post_init__(self) -> None:
        """Checks every setting; the message names it, what was found and what is allowed."""
        for name, allowed in (("method", METHODS), ("kernel", KERNELS)):
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name} must be one of {', '.join(allowed)}, got {getattr(self, name)!r}"
                )
        for count in self.component_counts or (self.components,):
            self._check_count("components", count)
        for name in (
            "features",
            "ensemble",
            "batch_size",
            "max_epochs",
            "patience",
            "synthetic",
            "emulator_features",
        ):
            self._check_count(name, getattr(self, name))
        for name in ("length_scale", "learning_rate"):
            self._check_real(name, low=0.0, exclusive=True)
        for name in ("jitter", "weight_decay"):
            self._check_real(name, low=0.0)
        self._check_real("validation_share", low=0.0, exclusive=True, high=0.5)
        self._check_real("test_share", low=0.0, high=0.5)
        for name in ("snr", "linear_start"):
            if not isinstance(getattr(self, name), bool):
                raise ValueError(f"{name} must be True or False, got {getattr(self, name)!r}")

    @property
    def component_counts(self) -> tuple[int, ...]:
        """The numbers of `components` to choose from."""
        counts = self.components
        return tuple(counts) if isinstance(counts, tuple | list) else (counts,)

    @staticmethod
    def _check_count(name: str, value: Any) -> None:
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise ValueError(f"{name} must be a whole number of at least 1, got {value!r}")

    def _check_real(
        self, name: str, *, low: float, high: float = float("inf"), exclusive: bool = False
    ) -> None:
        value = getattr(self, name)
        is_real = isinstance(value, int | float) and not isinstance(value, bool)
        # Written so that NaN fails.
        is_inside = is_real and (low < value if exclusive else low <= value) and value <= high
        if is_inside and value < float("inf"):
            return
        sign = "more than" if exclusive else "at least"
        raise ValueError(f"{name} must be {sign} {low} and at most {high}, got {value!r}")

    @classmethod
    def from_options(cls, **options: Any) -> "Config":
        """Returns the method's settings with `options` put over them.

        Raises:
            ValueError: an option that does not exist, or a value that is not allowed.
        """
        known = [field.name for field in fields(cls)]
        unknown = sorted(set(options) - set(known))
        if unknown:
            raise ValueError(f"unknown option {', '.join(unknown)}; known are {', '.join(known)}")
        return cls(**{**_DEFAULTS.get(str(options.get("method")), {}), **options})

    def as_dict(self) -> dict[str, Any]:
        """Returns the settings as plain values, for JSON."""
        return asdict(self)
