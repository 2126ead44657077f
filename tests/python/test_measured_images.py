import json

import numpy as np
import pytest

from granulcal.demo import measured_data
from granulcal.experiments import measured_images, sensor
from granulcal.measured.recording import Recording

_DATA = measured_data()
_needs_data = pytest.mark.skipif(
    _DATA is None or not (_DATA / "granular-impact-kinect").is_dir(),
    reason="measured images are absent: set GRANULCAL_DATA to their folder",
)


@_needs_data
@pytest.mark.parametrize(
    ("name", "kind"), [("compacted_5", "pile"), ("fluidized_5", "ring"), ("plane_5", "flat")]
)
def test_a_measured_map_is_what_its_label_says(name, kind):
    assert _DATA is not None
    recording = Recording.open(_DATA / "granular-impact-kinect" / "data" / f"{name}.npz")
    volume = measured_images.reference_volumes(_DATA).get(name, float("nan"))
    seen = measured_images.see("kinect", name, kind, recording, volume)
    assert seen.kind == kind
    assert seen.levelled.plane.tilt_deg < 0.5
    assert 1e-4 < seen.levelled.ground_sd < 1.2e-3
    if kind == "pile":
        assert seen.formation is not None
        assert seen.formation.volume == pytest.approx(volume, rel=0.1)
        assert seen.formation.mask.shape == seen.levelled.mask.shape


@_needs_data
def test_raw_frames_become_recordings(tmp_path):
    assert _DATA is not None
    rest = [i for i in measured_images.images(tmp_path, _DATA) if i[0] != "kinect"]
    assert [name for _, name, _, _ in rest] == [
        "depth_raw_a",
        "depth_raw_b",
        "frame_cropped",
        "topo_cone",
        "topo_ring",
        "depth0",
        "depth1",
    ]
    for rig, name, label, recording in rest[2:5]:
        seen = measured_images.see(rig, name, label, recording, float("nan"))
        assert np.isfinite(seen.levelled.heights[seen.levelled.mask]).all(), name


def test_the_table_counts_kinds_and_volumes(tmp_path):
    y, x = np.mgrid[-40:40, -40:40] * 1.0
    heights = np.maximum(0.0, 20.0 - np.hypot(x, y))
    path = tmp_path / "cone.npz"
    np.savez(path, depthmap=heights, xres=1.0, yres=1.0, zres=1.0, scale="mm")
    cone = np.pi * 0.02**2 * 0.02 / 3
    recording = Recording.open(path)
    seen = [
        measured_images.see("sandbox", "cone", label, recording, cone) for label in ("pile", "ring")
    ]
    table = measured_images._table(seen)
    assert "pile (is ring)" in table
    assert "kinds right: 1 of 2 labelled maps" in table
    off = 100 * abs(seen[0].levelled.heights[seen[0].levelled.mask].sum() * 1e-6 / cone - 1)
    assert f"by {off:.1f} % at most" in table


def test_levelling_takes_a_flat_bed(tmp_path):
    noise = 0.3 * np.random.default_rng(1).standard_normal((80, 80))
    path = tmp_path / "bed.npz"
    np.savez(path, depthmap=noise, xres=1.0, yres=1.0, zres=1.0, scale="mm")
    recording = Recording.open(path)
    levelled = recording.level(ground_resolution=2.2e-3)
    assert (levelled.downsample, levelled.resolution) == (2, pytest.approx((2e-3, 2e-3), rel=1e-3))
    assert levelled.heights.shape == levelled.mask.shape == (40, 40)
    assert not levelled.mask.any()
    assert levelled.ground_sd == pytest.approx(3e-4, rel=0.1)
    with pytest.raises(ValueError, match="none of .* pixels belongs to a grain"):
        recording.formation()
    with pytest.raises(ValueError, match="max_tilt_deg"):
        recording.level(max_tilt_deg=120.0)


def test_a_report_of_a_fit_is_judged():
    lags = np.arange(5.0)
    zero = [0.0] * 5

    def split(noise: np.ndarray) -> dict:
        return {
            "noise": {"x": noise.tolist(), "y": noise.tolist()},
            "fixed_pattern": {"x": zero, "y": zero},
        }

    measured, model = np.exp(-lags / 2), 1.21 * np.exp(-lags / 2)
    covariances = {"measured": split(measured), "model": split(model), "spread": split(0 * lags)}
    judged = sensor.judge({"check": {"covariances": covariances}})
    assert judged.ratio == pytest.approx(1.1)
    assert judged.near == pytest.approx(0, abs=1e-12)
    # exp(-1/2) and exp(-1) lie about a half: the line between them crosses it at 1.45.
    half = 1 + (np.exp(-0.5) - 0.5) / (np.exp(-0.5) - np.exp(-1.0))
    assert judged.half == pytest.approx((half,) * 4)


@pytest.mark.slow
@_needs_data
def test_the_sensor_of_the_boards_is_fitted(tmp_path):
    assert _DATA is not None
    judged = sensor.fit_surface("board", tmp_path, _DATA, sessions=6)
    assert json.loads((tmp_path / "board.json").read_text())["sensor"]["kind"] == "stereo"
    assert judged.ratio == pytest.approx(1, abs=0.15)
    assert judged.near < 0.15
