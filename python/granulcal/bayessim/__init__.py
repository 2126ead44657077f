"""BayesSim: a posterior of parameters from statistics, by mixture density on random features.

Torch is loaded when a model is first trained, and not before.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from granulcal.bayessim.check.calibration import Calibration
    from granulcal.bayessim.check.misfit import Misfit
    from granulcal.bayessim.model import BayesSim
    from granulcal.bayessim.training.config import Config
    from granulcal.bayessim.training.summary import TrainingSummary

__all__ = ["BayesSim", "Calibration", "Config", "Misfit", "TrainingSummary"]

_HOMES = {
    "BayesSim": "model",
    "Calibration": "check.calibration",
    "Config": "training.config",
    "Misfit": "check.misfit",
    "TrainingSummary": "training.summary",
}


def __getattr__(name: str) -> Any:
    """Loads the module that holds `name` on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
