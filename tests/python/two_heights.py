"""What a closed loop leaves for `predict`, the least of it: one statistic from two heights."""

import numpy as np

from granulcal.loop.report.models import Maker, Models
from granulcal.pours.scene import Scene


def two_heights(scene: Scene, statistic: str, *, verdict: str = "NONE") -> Models:
    """Two pours each from 10 mm, where the statistic is 0.01, and from 20 mm, where it is 0.02."""
    return Models(
        scene=scene,
        verdict={"kind": verdict, "named": []},
        paths=("start.height", "material.restitution"),
        inputs=(("start.height", 0.01, 0.02),),
        names=(statistic,),
        makers={name: (Maker({}, {}, {}),) * 2 for name in ("base", "named")},
        columns=(),
        transforms=(),
        correction=None,
        known=np.array([[0.0], [1.0]]),
        means=np.array([[0.01], [0.02]]),
        scatter=np.array([[0.001], [0.001]]),
        pours=np.array([2.0, 2.0]),
    )
