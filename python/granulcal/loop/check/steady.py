r"""Whether a mean over time is that of a surface that stands, asked of one pour before any data.

The mean surface of grains that keep moving is compared with a picture's, which was taken long after
the begin. A mean that is taken while the surface is still being built is the model's own error, and
looks like physics: friction, fill and cohesion bend a surface, too. So one pour at the middle of
the prior goes on for four times as long as its mean under each condition. With the slope of the
mean less that of these four, D, and s the standard deviation of the four, a sentence says that the
surface is not steady where

$$ |D| > 1^\circ, \qquad |D| > 3 s \sqrt{1 + 1/4}. $$
"""

import numpy as np

from granulcal.loop.task import Task
from granulcal.pours.pour_time import in_the_middle
from granulcal.pours.simulate import simulate

__all__ = ["SLOPE", "drifts"]

SLOPE = "surface_slope"
"""The series that is looked at [deg]."""

_LATER, _TIMES = 4, 3.0
# A smaller difference is none that a picture would show [deg].
_DIFFERENCE = 1.0
_SEED = 8_700_001


def drifts(task: Task) -> list[str]:
    """Returns a sentence for each condition whose mean surface does not stand; none without one.

    Args:
        task: what is asked; a pour is made under each condition if its scene observes a surface.
    """
    if SLOPE not in task.scene.observed_names:
        return []
    middle = in_the_middle(task.scene, task.prior)
    found = []
    for condition in task.conditions:
        scene = middle.with_(condition.at)
        begin, end = scene.get("observe.begin"), scene.get("end.horizon")
        longer = scene.with_({"end.horizon": end + _LATER * (end - begin)})
        _, slope = simulate(longer, seed=_SEED).series(SLOPE)
        own, *later = (part.mean() for part in np.array_split(slope, 1 + _LATER))
        stands, scatter = np.mean(later), np.std(later, ddof=1) * np.sqrt(1 + 1 / _LATER)
        if not abs(own - stands) <= max(_DIFFERENCE, _TIMES * scatter):
            found.append(
                f"{condition.name}: the surface is not steady: its slope is {own:.1f} degrees in "
                f"the mean from {begin:g} to {end:g} s and {stands:.1f} afterwards; let "
                "observe.begin and end.horizon be later"
            )
    return found
