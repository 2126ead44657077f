"""Materials, scenes and beds in the words of other simulators; docs/export.md derives every formula."""

from granulcal.export.engines import (
    ENGINES,
    DeepContactWarning,
    export_bed,
    export_material,
    export_scene,
)
from granulcal.export.frames import export_frames
from granulcal.export.posterior import export_posterior

__all__ = [
    "ENGINES",
    "DeepContactWarning",
    "export_bed",
    "export_frames",
    "export_material",
    "export_posterior",
    "export_scene",
]
