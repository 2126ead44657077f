"""Depth frames from a camera at this computer: a RealSense, a topic of ROS 2, one's own source."""

import time
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from granulcal import _native
from granulcal.measured.ros_files import SATURATED, DepthFrame, write_bag, write_mcap

__all__ = ["RealSense", "Ros2", "Source", "record", "require_recordable"]

_WARM_UP = 30
_PATIENCE_S = 5.0
# All of them are in memory until the file is written: 2.5 GB of a RealSense.
_MOST_FRAMES = 1000
# Metres per count of depths that come in metres: the finer while the farthest fits into 16 bits.
_FINE, _MILLIMETRE = 1e-4, 1e-3


class Source(Protocol):
    """Something that delivers depth frames."""

    @property
    def lens(self) -> dict[str, float]:
        """Returns width, height, fx, fy, cx, cy [px], the first pixel's centre at 0."""
        ...

    @property
    def depth_unit(self) -> float:
        """Returns metres per count."""
        ...

    def frames(self) -> Iterator[DepthFrame]:
        """Yields frames for as long as it is asked."""
        ...


class RealSense:
    """A RealSense camera, through librealsense's Python package.

    Args:
        width, height: of the depth image [px].
        fps: frames a second.
        module: librealsense, `pyrealsense2` unless given.

    Raises:
        ModuleNotFoundError: pyrealsense2 is not installed.
        OSError: no camera answers.
    """

    def __init__(
        self, *, width: int = 640, height: int = 480, fps: int = 30, module: Any = None
    ) -> None:
        if module is None:
            import pyrealsense2 as module  # pyright: ignore[reportMissingImports]
        self._pipeline = module.pipeline()
        config = module.config()
        config.enable_stream(module.stream.depth, width, height, module.format.z16, fps)
        try:
            profile = self._pipeline.start(config)
        except RuntimeError as error:
            raise OSError(f"no RealSense camera answers: {error}") from None
        self.depth_unit: float = profile.get_device().first_depth_sensor().get_depth_scale()
        """Metres per count."""
        stream = profile.get_stream(module.stream.depth).as_video_stream_profile()
        lens = stream.get_intrinsics()
        self.lens: dict[str, float] = {
            "width": lens.width, "height": lens.height, "fx": lens.fx, "fy": lens.fy,
            "cx": lens.ppx, "cy": lens.ppy,
        }  # fmt: skip
        """Lens [px]."""

    def frames(self) -> Iterator[DepthFrame]:
        """Yields frames; those of the first second, in which exposure settles, are left out."""
        try:
            for _ in range(_WARM_UP):
                self._pipeline.wait_for_frames()
            while True:
                frame = self._pipeline.wait_for_frames().get_depth_frame()
                if frame:
                    counts = np.asanyarray(frame.get_data())
                    depth = _metres(counts, self.depth_unit)
                    yield DepthFrame(depth, round(frame.get_timestamp() * 1e6))
        finally:
            self._pipeline.stop()


class Ros2:
    """A depth topic of ROS 2 and the camera_info beside it.

    Args:
        topic: of sensor_msgs/Image, 16UC1 (millimetres) or 32FC1 (metres).
        info: of sensor_msgs/CameraInfo; the default is `camera_info` beside the topic.
        node: a node of rclpy; one is made unless given.

    Raises:
        ModuleNotFoundError: rclpy is not installed: source ROS 2's setup first.
        OSError: nothing arrives within five seconds.
        ValueError: the lens distorts and the topic is not rectified.
    """

    def __init__(self, topic: str, info: str | None = None, *, node: Any = None) -> None:
        import rclpy  # pyright: ignore[reportMissingImports]
        from sensor_msgs.msg import CameraInfo, Image  # pyright: ignore[reportMissingImports]

        if node is None:
            rclpy.init()
            node = rclpy.create_node("granulcal_record")
        self._node, self._spin, self._topic = node, rclpy.spin_once, topic
        self._arrived: list[Any] = []
        self._infos: list[Any] = []
        beside = info or f"{topic.rsplit('/', 1)[0]}/camera_info"
        node.create_subscription(Image, topic, self._arrived.append, 10)
        node.create_subscription(CameraInfo, beside, self._infos.append, 10)
        self.lens: dict[str, float] = _lens_of(self._wait(self._infos, beside), topic, beside)
        """Lens [px]."""
        self.depth_unit = _MILLIMETRE
        """Metres per count: of 16UC1 by REP 118; of 32FC1 finer, where what it sees is near."""
        self._farthest = 0.0

    def frames(self) -> Iterator[DepthFrame]:
        """Yields frames as they arrive.

        Raises:
            OSError: none arrives within five seconds.
            ValueError: other pixels than depths, or an image of another size than the lens.
        """
        while True:
            message = self._wait(self._arrived, self._topic)
            width, height = self.lens["width"], self.lens["height"]
            if (message.width, message.height) != (width, height):
                raise ValueError(
                    f"{self._topic} must be of {width}x{height} pixels as its camera_info, got "
                    f"{message.width}x{message.height}: is the lens another's (--camera-topic)?"
                )
            frame = _frame_of(message)
            if message.encoding == "32FC1":
                self._farthest = max(self._farthest, float(frame.depth.max(initial=0.0)))
                is_near = self._farthest <= _FINE * (SATURATED - 1)
                self.depth_unit = _FINE if is_near else _MILLIMETRE
            yield frame

    def _wait(self, arrived: list[Any], topic: str) -> Any:
        end = time.monotonic() + _PATIENCE_S
        while not arrived:
            if time.monotonic() > end:
                raise OSError(f"nothing arrived on {topic} within {_PATIENCE_S:g} s")
            self._spin(self._node, timeout_sec=0.1)
        return arrived.pop(0)


def _lens_of(info: Any, topic: str, beside: str) -> dict[str, float]:
    """The lens as it is taken of a file: P of a rectified topic, else K, free of distortion."""
    words = topic.rsplit("/", 1)[-1].split("_")
    is_rectified = "rect" in words or "rectified" in words
    distortion = [float(coefficient) for coefficient in info.d]
    if not is_rectified and any(distortion):
        raise ValueError(
            f"the distortion of {beside} must be zero: record the rectified depth, got {distortion}"
        )
    k, p = info.k, info.p
    fx, fy, cx, cy = (
        (p[0], p[5], p[2], p[6]) if is_rectified and p[0] > 0 else (k[0], k[4], k[2], k[5])
    )
    return {"width": info.width, "height": info.height, "fx": fx, "fy": fy, "cx": cx, "cy": cy}


def _metres(counts: np.ndarray, unit: float) -> np.ndarray:
    """Depths of counts [m], 0 where the camera saturated."""
    return np.where(counts == SATURATED, 0.0, counts.astype(float) * unit)


def _frame_of(message: Any) -> DepthFrame:
    kinds = {"16UC1": ("u2", _MILLIMETRE), "mono16": ("u2", _MILLIMETRE), "32FC1": ("f4", 1.0)}
    if message.encoding not in kinds:
        raise ValueError(f"depth must be one of {', '.join(kinds)}, got {message.encoding!r}")
    letters, unit = kinds[message.encoding]
    kind = f"{'>' if message.is_bigendian else '<'}{letters}"
    rows = np.frombuffer(bytes(message.data), np.uint8).reshape(message.height, message.step)
    width = message.width * np.dtype(kind).itemsize
    pixels = np.ascontiguousarray(rows[:, :width]).view(kind)
    stamp = message.header.stamp
    # Infinite is too far, or too near: no data, as NaN.
    depth = np.nan_to_num(_metres(pixels, unit), posinf=0.0, neginf=0.0)
    return DepthFrame(depth, stamp.sec * 1_000_000_000 + stamp.nanosec)


def require_recordable(path: str | PathLike[str], frames: int) -> None:
    """Refuses a number of frames that is not recorded, and a file that is not written.

    Raises:
        ValueError: names it.
    """
    if not 1 <= frames <= _MOST_FRAMES:
        raise ValueError(f"frames must be from 1 to {_MOST_FRAMES}, got {frames}")
    if Path(path).suffix.lower() not in (".bag", ".mcap"):
        raise ValueError(f"{path} must end in .bag or .mcap")
    _native.check_paths([], [("path", path, "messages")])


def record(source: Source, path: str | PathLike[str], *, frames: int = 10) -> int:
    """Records depth frames into a .bag or an .mcap and returns their number.

    Args:
        source: of the frames.
        path: .bag as the RealSense viewer lays it out, .mcap as `ros2 bag` does.
        frames: how many.

    Raises:
        ValueError: another name, one of a file that is there, or no frames asked for.
        OSError: the source delivers nothing.
    """
    # Before the camera is asked.
    require_recordable(path, frames)
    delivered = source.frames()
    try:
        taken = [frame for frame, _ in zip(delivered, range(frames), strict=False)]
    finally:
        close = getattr(delivered, "close", None)
        if close is not None:
            close()
    if not taken:
        raise OSError("the source delivered no frame")
    if Path(path).suffix.lower() == ".bag":
        return write_bag(path, taken, source.lens, depth_unit=source.depth_unit)
    return write_mcap(path, taken, source.lens)
