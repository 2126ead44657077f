"""A ball of grains that falls on a bed of them: what the map of after less before shows."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import granulcal as gc
from granulcal.experiments.loop_rings.shape import Shape, profile, simulated
from granulcal.export.setup import Setup

Array = NDArray[np.float64]

RING = Path(__file__).parents[2] / "examples" / "ring.toml"


def ring(height: float) -> gc.Pour:
    """A ball of 300 grains and a tray of 2,400."""
    small = {
        "grains.count": 300,
        "bed.radius": 0.07,
        "walls.0.shape.radius": 0.07,
        "bed.height": 0.03,
        "bed.jitter": 2e-4,
        "bed.settle": 0.25,
        "start.height": height,
    }
    return gc.simulate(gc.Scene.load(RING).with_(small), seed=1)


def test_a_fall_from_high_digs_a_crater_with_a_rim_and_one_from_low_heaps() -> None:
    radii, deep = profile(*simulated(ring(1.0)))
    _, heap = profile(*simulated(ring(0.05)))
    within, around = radii < 0.02, (radii > 0.035) & (radii < 0.06)
    assert deep[within].mean() < -3e-3 and deep[around].max() > 2e-3
    assert heap[within].mean() > 3e-3 and np.abs(heap[radii > 0.05]).max() < 1e-3


def test_nothing_is_seen_where_nothing_has_moved() -> None:
    pour = ring(0.05)
    heights, spacing = simulated(pour)
    along = spacing * (np.arange(len(heights)) - 0.5 * (len(heights) - 1))
    radius = np.hypot(along[:, None], along)
    assert np.all(heights[radius > 0.072] == 0.0)
    # Far from where it lands the tray is as it was but for some grains.
    assert np.mean(np.abs(heights[(radius > 0.055) & (radius < 0.068)]) > 1e-3) < 0.2
    # What stands above the bed are the grains of the statistics.
    assert pour.points()[:, 2].min() > 1e-3


@pytest.mark.parametrize(
    ("heights", "depth", "rim", "radius"),
    [
        # Debris in the middle of a crater is not its rim.
        (lambda r: np.where(r < 0.01, 9e-3, np.where(r < 0.06, -4e-3, 0)), 4e-3, 0.0, 0.063),
        (lambda r: 6e-3 * np.exp(-(((r - 0.09) / 0.02) ** 2)) - 1e-3, 1e-3, 5e-3, 0.09),
        (lambda r: 8e-3 * np.exp(-((r / 0.04) ** 2)), 0.0, 4.3e-3, 0.033),
    ],
)
def test_a_profile_is_told_by_its_crater_and_rim(
    heights: Callable[[Array], Array], depth: float, rim: float, radius: float
) -> None:
    radii = np.arange(0.003, 0.15, 0.006)
    shape = Shape.of(radii, heights(radii))
    assert shape.depth == pytest.approx(depth, abs=2e-4)
    assert shape.rim == pytest.approx(rim, abs=3e-4)
    assert shape.radius == pytest.approx(radius, abs=4e-3)


def test_other_engines_files_have_no_bed() -> None:
    with pytest.raises(ValueError, match="`bed` has no counterpart"):
        Setup.of(gc.Scene.load(RING))
