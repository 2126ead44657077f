"""Closing the loop: is a residual left, which effect left it, and what is gone when it is added.

`docs/theory/loop.md` derives what the files do.
"""

from granulcal.loop.check.discrepancy import Discrepancy
from granulcal.loop.condition import Condition
from granulcal.loop.effects.design import Design, Effect
from granulcal.loop.experiment import Experiment, next_experiment
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import Task
from granulcal.loop.test.distance import Improvement, compare
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import Power, Trace, power, trace
from granulcal.loop.test.verdict import Verdict

__all__ = [
    "Condition",
    "ConditionPours",
    "Design",
    "Discrepancy",
    "Effect",
    "Experiment",
    "Improvement",
    "Power",
    "Surrogate",
    "Task",
    "Thresholds",
    "Trace",
    "Verdict",
    "compare",
    "next_experiment",
    "power",
    "trace",
]
