"""Recording from a camera: a fake librealsense and a source of one's own stand for the hardware."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import granulcal as gc
from granulcal.cli import main
from granulcal.measured.live import RealSense, Ros2, _frame_of, _lens_of, record
from granulcal.measured.ros_files import DepthFrame, write_bag, write_mcap

pytest.importorskip("rosbags")
LENS = {"width": 64, "height": 48, "fx": 60.0, "fy": 61.0, "cx": 31.5, "cy": 23.5}


def depth(frame: int) -> np.ndarray:
    """A tilted plane, half a metre away, with a hole."""
    v, u = np.mgrid[:48, :64]
    z = 0.5 + 1e-4 * u + 2e-4 * v + 1e-4 * frame
    z[10:12, 20:22] = 0.0
    return z


class OwnSource:
    lens, depth_unit = LENS, 1e-4

    def __init__(self) -> None:
        self.is_closed = False

    def frames(self) -> Iterator[DepthFrame]:
        try:
            for i in range(100):
                yield DepthFrame(depth(i), 1_000_000_000 + i * 33_000_000)
        finally:
            self.is_closed = True


class FakeRealSense:
    """What `record` needs of pyrealsense2."""

    stream = SimpleNamespace(depth="depth")
    format = SimpleNamespace(z16="z16")

    def __init__(self, *, answers: bool = True) -> None:
        self.answers, self.waited, self.is_stopped, self.asked = answers, 0, False, ()

    def config(self) -> Any:
        return SimpleNamespace(enable_stream=lambda *words: setattr(self, "asked", words))

    def pipeline(self) -> Any:
        return SimpleNamespace(start=self.start, stop=self.stop, wait_for_frames=self.wait)

    def start(self, config: Any) -> Any:
        if not self.answers:
            raise RuntimeError("No device connected")
        sensor = SimpleNamespace(get_depth_scale=lambda: 1e-4)
        lens = SimpleNamespace(width=64, height=48, fx=60.0, fy=61.0, ppx=31.5, ppy=23.5)
        video = SimpleNamespace(get_intrinsics=lambda: lens)
        return SimpleNamespace(
            get_device=lambda: SimpleNamespace(first_depth_sensor=lambda: sensor),
            get_stream=lambda kind: SimpleNamespace(as_video_stream_profile=lambda: video),
        )

    def stop(self) -> None:
        self.is_stopped = True

    def wait(self) -> Any:
        self.waited += 1
        counts = np.round(depth(self.waited) / 1e-4).astype(np.uint16)

        class Frame:
            def get_data(self) -> np.ndarray:
                return counts

            def get_timestamp(self) -> float:
                return 1000.0

        return SimpleNamespace(get_depth_frame=Frame)


@pytest.mark.parametrize("name", ["own.bag", "own.mcap"])
def test_frames_of_a_source_are_read_back(name: str, tmp_path: Path) -> None:
    source = OwnSource()
    assert record(source, tmp_path / name, frames=3) == 3
    assert source.is_closed
    recording = gc.Recording.open(tmp_path / name)
    assert recording.frames == 3 and recording.lens == pytest.approx(LENS)
    assert recording.depth is not None
    # The mean of three frames; the hole stays one.
    assert recording.depth[0, 0] == pytest.approx(0.5001, abs=6e-5)
    assert recording.depth[10, 20] == 0.0


def test_a_realsense_is_asked_warmed_up_and_stopped(tmp_path: Path) -> None:
    fake = FakeRealSense()
    source = RealSense(width=64, height=48, module=fake)
    assert fake.asked == ("depth", 64, 48, "z16", 30) and source.depth_unit == 1e-4
    assert record(source, tmp_path / "live.bag", frames=2) == 2
    assert fake.is_stopped and fake.waited >= 32
    recording = gc.Recording.open(tmp_path / "live.bag")
    assert recording.depth_unit == pytest.approx(1e-4) and recording.lens == pytest.approx(LENS)
    with pytest.raises(OSError, match="no RealSense camera answers: No device"):
        RealSense(module=FakeRealSense(answers=False))


def test_messages_of_ros_become_metres() -> None:
    header = SimpleNamespace(stamp=SimpleNamespace(sec=2, nanosec=5))
    counts = np.array([[500, 0], [501, 502]], "<u2")
    # Rows may be longer than the image.
    rows = np.hstack([counts.view(np.uint8), np.zeros((2, 2), np.uint8)])
    message = SimpleNamespace(
        header=header,
        encoding="16UC1",
        is_bigendian=0,
        width=2,
        height=2,
        step=6,
        data=rows.tobytes(),
    )
    frame = _frame_of(message)
    assert frame.time_ns == 2_000_000_005
    assert np.allclose(frame.depth, [[0.5, 0.0], [0.501, 0.502]])
    message.is_bigendian, message.data = 1, rows.view("<u2").astype(">u2").tobytes()
    assert np.allclose(_frame_of(message).depth, frame.depth)
    message.encoding = "rgb8"
    with pytest.raises(ValueError, match="got 'rgb8'"):
        _frame_of(message)


def test_the_lens_of_a_topic_is_chosen_as_of_a_file() -> None:
    k, p = [60.0, 0, 31.5, 0, 61.0, 23.5, 0, 0, 1], [50.0, 0, 30, 0, 0, 51, 22, 0, 0, 0, 1, 0]
    info = SimpleNamespace(width=64, height=48, d=[0.1, -0.05, 0.0, 0.0, 0.0], k=k, p=p)
    # Rectified images are of the projection, whatever the lens before them did.
    projected = {**LENS, "fx": 50.0, "fy": 51.0, "cx": 30.0, "cy": 22.0}
    assert _lens_of(info, "/cam/depth/image_rect_raw", "/cam/depth/camera_info") == projected
    with pytest.raises(ValueError, match="of /i must be zero: .* rectified depth, got .0.1"):
        _lens_of(info, "/rect/image_raw", "/i")
    info.d = []
    assert _lens_of(info, "/cam/depth/image_raw", "/i") == LENS
    info.p = [0.0] * 12
    assert _lens_of(info, "/cam/depth/image_rect", "/i") == LENS


@pytest.mark.parametrize("name", ["live.bag", "live.mcap"])
def test_saturated_counts_of_a_live_camera_are_no_data(name: str, tmp_path: Path) -> None:
    counts = np.round(depth(0) / 1e-3).astype("<u2")
    counts[20:30, 30:40] = 65535
    message = SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=0)),
        encoding="16UC1",
        is_bigendian=0,
        width=64,
        height=48,
        step=2 * 64,
        data=counts.tobytes(),
    )
    source = Ros2.__new__(Ros2)
    source.lens, source.depth_unit, source._farthest = LENS, 1e-3, 0.0
    source._wait = lambda arrived, topic: message
    source._arrived, source._topic = [], "/depth"
    assert record(source, tmp_path / name, frames=2) == 2
    found = gc.Recording.open(tmp_path / name).depth
    assert found is not None
    np.testing.assert_array_equal(found == 0, (counts == 65535) | (counts == 0))
    # A lens of another size would be refused when the grains are gone.
    source.lens = {**LENS, "width": 32}
    with pytest.raises(ValueError, match="/depth must be of 32x48 pixels .* got 64x48"):
        record(source, tmp_path / f"other-{name}", frames=2)
    assert not (tmp_path / f"other-{name}").exists()


def test_metres_of_ros_keep_a_tenth_of_a_millimetre(tmp_path: Path) -> None:
    # What is infinitely far, or no number, is no data.
    metres = depth(0).astype("<f4")
    metres[0, :3] = np.inf, -np.inf, np.nan
    message = SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=0)),
        encoding="32FC1",
        is_bigendian=0,
        width=64,
        height=48,
        step=4 * 64,
        data=metres.tobytes(),
    )
    source = Ros2.__new__(Ros2)
    source.lens, source.depth_unit, source._farthest = LENS, 1e-3, 0.0
    source._wait = lambda arrived, topic: message
    source._arrived, source._topic = [], "/depth"
    assert record(source, tmp_path / "ros.bag", frames=2) == 2
    found = gc.Recording.open(tmp_path / "ros.bag")
    assert found.depth_unit == pytest.approx(1e-4) and found.depth is not None
    assert (found.depth[0, :3] == 0).all()
    assert found.depth[1, 3] == pytest.approx(depth(0)[1, 3], abs=6e-5)
    # Beyond 6.55 m it does not fit into 16 bits.
    metres[5, 5] = 8.0
    message.data = metres.tobytes()
    next(source.frames())
    assert source.depth_unit == 1e-3


def test_what_cannot_be_recorded_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must end in .bag or .mcap"):
        record(OwnSource(), tmp_path / "x.png")
    with pytest.raises(ValueError, match="frames must be from 1 to 1000, got 0"):
        record(OwnSource(), tmp_path / "x.bag", frames=0)


def test_what_cannot_be_recorded_is_refused_before_a_camera_is_looked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """That no camera's package is installed had been said first."""
    for name, count, told in (
        ("x.bag", "0", "frames must be from 1 to 1000, got 0"),
        ("x.png", "5", "must end in .bag or .mcap"),
    ):
        assert main(["record", str(tmp_path / name), "--frames", count]) == 2
        assert told in capsys.readouterr().err


@pytest.mark.parametrize("name", ["couscous.bag", "couscous.mcap"])
def test_a_recording_that_is_there_stays(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    assert record(OwnSource(), path, frames=2) == 2
    before = path.read_bytes()
    source = OwnSource()
    with pytest.raises(ValueError, match="may not be had again"):
        record(source, path, frames=2)
    # Before the camera is asked.
    assert not source.is_closed
    write = write_bag if name.endswith("bag") else write_mcap
    with pytest.raises(ValueError, match="may not be had again"):
        write(path, source.frames(), LENS)
    assert path.read_bytes() == before


@pytest.mark.parametrize("name", ["late.bag", "late.mcap"])
def test_the_last_frames_are_the_last_in_time(name: str, tmp_path: Path) -> None:
    # As files are that were put together of two: later frames first.
    late, early = depth(0), np.full((48, 64), 0.7)
    frames = [DepthFrame(late if t > 3 else early, t * 1_000_000_000) for t in (4, 5, 6, 1, 2, 3)]
    path = tmp_path / name
    assert (write_bag if name.endswith("bag") else write_mcap)(path, frames, LENS) == 6
    last = gc.Recording.open(path, frames=3).depth
    first = gc.Recording.open(path, frames=3, first_frame=0).depth
    assert last is not None and np.allclose(last, late, atol=6e-5)
    assert first is not None and np.allclose(first, early, atol=6e-5)
