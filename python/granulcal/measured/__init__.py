"""Measurements that are no depth image, as the statistics that a scene observes."""

from granulcal.measured.discharge_curve import DischargeCurve
from granulcal.measured.drum_image import DrumImage
from granulcal.measured.named_values import NamedValues, is_of_named_values
from granulcal.measured.run_out import RunOut

__all__ = ["DischargeCurve", "DrumImage", "NamedValues", "RunOut", "is_of_named_values"]
