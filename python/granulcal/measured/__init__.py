"""Measurements that are no depth image, as the statistics that a scene observes."""

from granulcal.measured.discharge_curve import DischargeCurve
from granulcal.measured.drum_image import DrumImage
from granulcal.measured.run_out import RunOut

__all__ = ["DischargeCurve", "DrumImage", "RunOut"]
