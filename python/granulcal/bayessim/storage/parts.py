"""The parts of a trained model: what is written of it, and what it is joined from."""

from typing import Protocol, TypedDict

from granulcal.bayessim.check.calibration import Calibration
from granulcal.bayessim.check.identifiability import Identifiability
from granulcal.bayessim.check.misfit import MisfitReference
from granulcal.bayessim.emulator.likelihood import Likelihood
from granulcal.bayessim.network.amortised import Amortised
from granulcal.bayessim.network.standardise import Standardiser
from granulcal.bayessim.posterior.average import Average
from granulcal.bayessim.training.config import Config
from granulcal.bayessim.training.summary import TrainingSummary
from granulcal.prior import Prior

__all__ = ["Parts", "Trained"]


class Parts(TypedDict):
    """What a saved model is joined from: the arguments of `BayesSim`."""

    prior: Prior
    config: Config
    standardiser: Standardiser
    likelihood: Likelihood
    amortised: Amortised | None
    average: Average
    x_names: tuple[str, ...]
    misfit_reference: MisfitReference
    summary: TrainingSummary
    calibration: Calibration | None
    identifiability: Identifiability | None
    scene_toml: str | None
    law: int | None


class Trained(Protocol):
    """A trained model, as far as it is kept."""

    prior: Prior
    config: Config
    standardiser: Standardiser
    likelihood: Likelihood
    amortised: Amortised | None
    average: Average
    x_names: tuple[str, ...]
    misfit_reference: MisfitReference
    summary: TrainingSummary
    calibration: Calibration | None
    identifiability: Identifiability | None
    scene_toml: str | None
    law: int | None

    @property
    def scene_hash(self) -> str | None:
        """Hash of the scene that its pours were of, if it is known."""
        ...
