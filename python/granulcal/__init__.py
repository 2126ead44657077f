"""granulcal calibrates a granular simulator from depth images.

    >>> import granulcal as gc
    >>> scene = gc.Scene.drop(0.02, count=50)
    >>> pour = gc.simulate(scene, seed=1)
    >>> pour.statistics().paper16.shape
    (16,)

Torch is loaded when a model is first trained or loaded, matplotlib when something is first drawn.
"""

from typing import TYPE_CHECKING, Any

from granulcal._native import __version__
from granulcal.design.plan import Plan
from granulcal.design.ring import Ring
from granulcal.design.ring_model import RingModel
from granulcal.design.rings import design_rings
from granulcal.design.spill import design_spill
from granulcal.measured.recording import Formation, Levelled, Plane, Recording
from granulcal.pours.camera import Camera
from granulcal.pours.cluster import Cluster
from granulcal.pours.contacts import Contacts
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.pour import Pour
from granulcal.pours.scene import Material, Scene
from granulcal.pours.simulate import simulate
from granulcal.pours.simulation import Simulation
from granulcal.pours.statistics import (
    DiagnosticStatistics,
    ObservedStatistics,
    Statistics,
    diagnostic_statistics,
    statistics,
)
from granulcal.pours.trajectory import Trajectory
from granulcal.prior import Parameter, Prior

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim
    from granulcal.bayessim.posterior.posterior import Posterior
    from granulcal.loop.close import close_loop
    from granulcal.loop.condition import Condition
    from granulcal.loop.predict import predict
    from granulcal.loop.task import Task
    from granulcal.within_budget import calibrate_within

__all__ = [
    "BayesSim",
    "Camera",
    "Cluster",
    "Condition",
    "Contacts",
    "Dataset",
    "DiagnosticStatistics",
    "Formation",
    "Levelled",
    "Material",
    "ObservedStatistics",
    "Parameter",
    "Plan",
    "Plane",
    "Posterior",
    "Pour",
    "Prior",
    "Recording",
    "Ring",
    "RingModel",
    "Scene",
    "Simulation",
    "Statistics",
    "Task",
    "Trajectory",
    "__version__",
    "calibrate_within",
    "close_loop",
    "design_rings",
    "design_spill",
    "diagnostic_statistics",
    "generate",
    "predict",
    "simulate",
    "statistics",
]

_LAZY = {
    "BayesSim": "granulcal.bayessim",
    "Condition": "granulcal.loop.condition",
    "Posterior": "granulcal.bayessim.posterior.posterior",
    "Task": "granulcal.loop.task",
    "calibrate_within": "granulcal.within_budget",
    "close_loop": "granulcal.loop.close",
    "predict": "granulcal.loop.predict",
}


def __getattr__(name: str) -> Any:
    """Loads what needs heavy packages on first use."""
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_LAZY[name]), name)


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(_LAZY))
