"""How large the experiments are: the paper's size, a small version, and one for a test."""

from dataclasses import dataclass, field
from typing import Any

from granulcal.pours.scene import Scene

__all__ = ["FULL", "MEDIUM", "QUICK", "TINY", "Size"]


@dataclass(frozen=True, kw_only=True)
class Size:
    """Counts of everything.

    Attributes:
        name: `full`, `medium`, `quick` or `tiny`.
        grains: grains of a pour.
        pixels: of the camera's image, along a side.
        downsample: of them that become one.
        training: pours of a training set.
        tests: pours of a test set.
        repeats: pours of one material in the study of the noise.
        sweep: values of a parameter, and pours at each, in the propagation of error.
        sequence: pours of the study of sequences; each is seen several times.
        recordings: recordings at the height of calibration, and at each other height.
        spills: pours into the bowl, of each grain.
        shapes: pours of a training set of grains that are not round; with their two unknowns half
            of 100 do nearly as well (docs/results/paper.md), and a pour takes as long as 20 others.
        subsets: whether the ablation looks at every pair and a hundred random subsets.
        fit: settings of `BayesSim.fit`.
        note: what is to be said of its numbers, if they do not stand beside the paper's.
    """

    name: str
    grains: int = 2000
    pixels: int = 1920
    downsample: int = 20
    training: int = 1000
    tests: int = 50
    repeats: int = 500
    sweep: tuple[int, int] = (25, 8)
    sequence: int = 1000
    recordings: tuple[int, int] = (10, 5)
    spills: int = 48
    shapes: int = 100
    subsets: bool = True
    fit: dict[str, Any] = field(default_factory=dict)
    note: str = ""

    @property
    def is_full(self) -> bool:
        """Whether its numbers may stand beside the paper's."""
        return self.name == "full"

    @property
    def verdict(self) -> str:
        """The verdict of every row that the size alone forbids to judge; empty at full size."""
        return "" if self.is_full else f"not judged: {self.name} version"

    def scene(self, height: float = 0.12) -> Scene:
        """Returns the paper's pour with this many grains."""
        scene = Scene.funnel(height=height, count=self.grains)
        return scene.with_({"camera.pixels": self.pixels, "camera.downsample": self.downsample})


_SMALL_NOTE = (
    "This is the small version: few grains and few pours. It shows that everything runs; its "
    "numbers are not to be compared with the paper's."
)
_SMALL_FIT = {"method": "emulated", "emulator_features": 60}

FULL = Size(name="full")
"""The paper's counts, or more."""
MEDIUM = Size(
    name="medium",
    grains=400,
    note="Pours of 400 grains and as many tests as the paper has: its numbers are to be compared "
    "with each other, with the paper's only in kind.",
)
"""A fifth of the grains, the paper's counts of tests: what grains that are not round allow."""
QUICK = Size(
    name="quick",
    grains=120,
    pixels=576,
    downsample=3,
    training=120,
    tests=10,
    repeats=20,
    sweep=(7, 3),
    sequence=100,
    recordings=(3, 1),
    spills=24,
    shapes=60,
    subsets=False,
    fit=_SMALL_FIT,
    note=_SMALL_NOTE,
)
"""Few grains and few pours: it shows that everything runs, its numbers compare with nothing."""
TINY = Size(
    name="tiny",
    grains=60,
    pixels=240,
    downsample=1,
    training=60,
    tests=4,
    repeats=6,
    sweep=(5, 2),
    sequence=60,
    recordings=(2, 1),
    spills=24,
    shapes=60,
    subsets=False,
    fit=_SMALL_FIT,
    note=_SMALL_NOTE,
)
"""For a test of the code."""
