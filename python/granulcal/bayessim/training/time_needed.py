"""How long a training or a check takes on this machine, from its first steps."""

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from granulcal.progress import first_steps

if TYPE_CHECKING:
    from granulcal.bayessim.model import BayesSim
    from granulcal.bayessim.training.pairs import TrainingPairs

__all__ = ["TrainingTime", "check_time", "training_time"]

# Fits of a part of the pairs, with constant and with varying noise, and the one of all.
_NOISES, _WHOLE = 2, 1
_PASSES, _CHECKED = 3, 10


@dataclass(frozen=True)
class TrainingTime:
    """Times of the parts of a training [s]; the check that follows is not among them.

    Attributes:
        emulator: all fits of the emulator.
        network: all passes of the network, which may stop earlier; 0 without one.
    """

    emulator: float
    network: float

    @property
    def seconds(self) -> float:
        """Both [s]."""
        return self.emulator + self.network


def training_time(data: Any, *, seed: int, method: str, **settings: Any) -> TrainingTime:
    """Returns how long `BayesSim.fit` takes, from a part of the emulator and passes of a network.

    Args:
        data: as for `BayesSim.fit`.
        seed: as there.
        method: as there.
        **settings: as there.

    Raises:
        TrainingDataError: as there.
    """
    from granulcal.bayessim.model import BayesSim

    def fit(name: str) -> "BayesSim":
        return BayesSim.fit(data, seed=seed, quiet=True, method=name, **settings)

    part = first_steps("emulator", 1, lambda: fit("emulated"))
    emulator = part.before + part.each * (_NOISES * part.total + _WHOLE)
    if method == "emulated":
        return TrainingTime(emulator, 0.0)
    # A network on the pairs begins at once; one that imitates the emulator needs it whole.
    first = method if method in ("distilled", "plain") else "mdrff"
    passes = first_steps("network", _PASSES, lambda: fit(first))
    counts = settings.get("components", ())
    return TrainingTime(emulator, passes.each * passes.total * max(len(counts), 1))


def check_time(model: "BayesSim", pairs: "TrainingPairs") -> float:
    """Returns how long `model.check` takes on pairs, from ten of them [s]."""
    few = min(_CHECKED, len(pairs.theta))
    begun = time.monotonic()
    model.check(pairs.theta[:few], pairs.x[:few])
    return (time.monotonic() - begun) * len(pairs.theta) / few
