"""Closing the loop: is a residual left, which effect left it, and what is gone when it is added.

`docs/theory/loop.md` derives what the files do.
"""

from granulcal.loop.design import Design, Effect
from granulcal.loop.observation import Observation
from granulcal.loop.surrogate import Surrogate
from granulcal.loop.thresholds import Thresholds
from granulcal.loop.trace import Power, Trace, power, trace
from granulcal.loop.verdict import Verdict

__all__ = [
    "Design",
    "Effect",
    "Observation",
    "Power",
    "Surrogate",
    "Thresholds",
    "Trace",
    "Verdict",
    "power",
    "trace",
]
