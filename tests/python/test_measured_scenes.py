"""The study of measured scenes: its arithmetic, and its scenes."""

from pathlib import Path

import numpy as np
import pytest

import granulcal as gc
from granulcal.demo import measured_data
from granulcal.experiments import measured_scenes
from granulcal.experiments.measured_scenes import column, drum

_HERE = Path(measured_scenes.__file__).parent


def test_fronts_are_compared_at_the_measured_frames():
    time = np.linspace(0.0, 1.0, 11)
    radius = 0.05 + 0.1 * time
    measured_time = np.array([0.1, 0.3, 0.5, 2.0])
    measured = np.array([0.06, np.nan, 0.096, 0.5])
    rms, mean = column.compare(time, radius, measured_time, measured, shift=0.0)
    # Off by 0 and by +4 mm; NaN and what lies after the simulated end are left out.
    assert mean == pytest.approx(2e-3)
    assert rms == pytest.approx(np.sqrt(8.0) * 1e-3)
    assert column.first_passage(time, radius, 0.085) == pytest.approx(0.35)
    assert np.isnan(column.first_passage(time, radius, 0.2))


def test_profiles_are_compared_without_their_slope():
    measured = np.array([0.01, 0.0, -0.01, 40.0])
    off = np.array([0.003, 0.0, 0.0, 9.0])
    assert drum.rms_mm(measured + off, measured) == pytest.approx(np.sqrt(3.0))


@pytest.mark.parametrize("name", ["drum", "column", "hopper", "hopper_cylinders"])
def test_the_studys_scenes_observe_what_was_measured(name: str):
    scene = gc.Scene.load(_HERE / f"{name}.toml")
    wanted = {"drum": "surface_slope", "column": "front_radius[end]", "hopper": "discharge_rate"}
    wanted["hopper_cylinders"] = wanted["hopper"]
    assert wanted[name] in scene.observed_names


def test_the_measured_drums_have_their_slopes():
    data = measured_data()
    if data is None or not (data / "granudrum-mcc").is_dir():
        pytest.skip("measured drums are absent: set GRANULCAL_DATA to their folder")
    slopes = [found.measured[-1] for found in drum.drums(data)]
    # As stated with the data: 40.4 and 52.7 degrees.
    assert slopes == pytest.approx([40.4, 52.7], abs=0.3)
