"""Depth frames as a camera's software writes them: a RealSense .bag of ROS 1, an .mcap of ROS 2.

The layout of the .bag is that of the RealSense viewer (librealsense, `ros_file_format.h`): topics
`/device_0/sensor_0/Depth_0/image/data` and `.../info/camera_info`, the depth unit as an option of
the sensor. The .mcap has the topics of the realsense2_camera node. rosbags writes both.
"""

import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from granulcal import _native
from granulcal.files import replace_file

__all__ = ["SATURATED", "DepthFrame", "write_bag", "write_mcap"]

SATURATED = 65535
"""The count that cameras write where they saturate: no data."""

Image = NDArray[np.uint16]
_SENSOR = "/device_0/sensor_0"
_CAMERA = "/camera/depth"
_OPTICAL = "camera_depth_optical_frame"
# The unit of 16UC1 in ROS 2 is the millimetre (REP 118).
_MILLIMETRE = 1e-3


@dataclass(frozen=True)
class DepthFrame:
    """One depth image.

    Attributes:
        depth: depth [m], 0 is no data, shape (h, w).
        time_ns: when it was taken, on any clock [ns].
    """

    depth: NDArray[np.floating]
    time_ns: int


class _Messages:
    """Messages of one version of ROS, of one lens."""

    def __init__(self, *, ros1: bool, lens: dict[str, float]) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.ros1, self.lens = ros1, lens

    def make(self, name: str, **fields: Any) -> Any:
        if self.ros1 and name == "std_msgs/msg/Header":
            fields["seq"] = 0
        return self.store.types[name](**fields)

    def header(self, frame: str, time_ns: int) -> Any:
        seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
        stamp = self.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def image(self, frame: str, time_ns: int, encoding: str, pixels: NDArray[Any]) -> Any:
        data = np.frombuffer(np.ascontiguousarray(pixels).tobytes(), np.uint8)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(frame, time_ns),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            is_bigendian=0,
            step=len(data) // pixels.shape[0],
            data=data,
        )

    def camera(self, frame: str, time_ns: int) -> Any:
        lens = self.lens
        fx, fy, cx, cy = (float(lens[name]) for name in ("fx", "fy", "cx", "cy"))
        region = self.make(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False,
        )  # fmt: skip
        names = ("D", "K", "R", "P") if self.ros1 else ("d", "k", "r", "p")
        k = np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1], float)
        p = np.array([fx, 0, cx, 0, 0, fy, cy, 0, 0, 0, 1, 0], float)
        values = (np.zeros(5), k, np.eye(3).ravel(), p)
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(frame, time_ns),
            height=int(lens["height"]),
            width=int(lens["width"]),
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=region,
            **dict(zip(names, values, strict=True)),
        )


def write_bag(
    path: str | PathLike[str],
    frames: Iterable[DepthFrame],
    lens: dict[str, float],
    *,
    depth_unit: float = 1e-4,
    replace: bool = False,
) -> int:
    """Writes frames as the RealSense viewer saves them, lz4-compressed; returns their number.

    Args:
        path: the .bag file.
        frames: depth images of one size.
        lens: width, height, fx, fy, cx, cy [px], the first pixel's centre at 0.
        depth_unit: metres per count.
        replace: what stands there is the caller's to replace; else it is left as it is, for a
            recording may not be had again.

    Raises:
        ModuleNotFoundError: rosbags is not installed.
        ValueError: something stands there that is not to be replaced.
    """
    from rosbags.rosbag1 import Writer

    ros, count = _Messages(ros1=True, lens=lens), 0
    with _draft(path) as folder:
        writer = Writer(folder / "draft.bag")
        writer.set_compression(Writer.CompressionFormat.LZ4)
        with writer:
            connections: dict[str, Any] = {}

            def write(topic: str, name: str, time_ns: int, message: Any) -> None:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, name, typestore=ros.store)
                writer.write(connections[topic], time_ns, ros.store.serialize_ros1(message, name))

            stream = f"{_SENSOR}/Depth_0"
            unit = ros.make("std_msgs/msg/Float32", data=depth_unit)
            write(f"{_SENSOR}/option/Depth Units/value", "std_msgs/msg/Float32", 1, unit)
            camera = ros.camera("", 0)
            write(f"{stream}/info/camera_info", "sensor_msgs/msg/CameraInfo", 1, camera)
            for frame in frames:
                picture = ros.image("0", frame.time_ns, "mono16", _counts(frame.depth, depth_unit))
                write(f"{stream}/image/data", "sensor_msgs/msg/Image", frame.time_ns + 2, picture)
                count += 1
        _put(Path(path), (folder / "draft.bag").read_bytes(), replace=replace)
    return count


def write_mcap(
    path: str | PathLike[str],
    frames: Iterable[DepthFrame],
    lens: dict[str, float],
    *,
    replace: bool = False,
) -> int:
    """Writes frames as `ros2 bag record` saves a realsense2_camera node; returns their number.

    Depths are 32FC1 in metres, 0 is no data; the lens is sent with each.

    Args:
        path: the .mcap file.
        frames: depth images of one size.
        lens: width, height, fx, fy, cx, cy [px], the first pixel's centre at 0.
        replace: as for `write_bag`.

    Raises:
        ModuleNotFoundError: rosbags is not installed.
        ValueError: something stands there that is not to be replaced.
    """
    from rosbags.rosbag2 import StoragePlugin, Writer

    ros, count = _Messages(ros1=False, lens=lens), 0
    with _draft(path) as place:
        folder = place / "bag"
        with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            writer_types = {
                f"{_CAMERA}/camera_info": "sensor_msgs/msg/CameraInfo",
                f"{_CAMERA}/image_rect_raw": "sensor_msgs/msg/Image",
            }
            connections = {
                topic: writer.add_connection(topic, name, typestore=ros.store)
                for topic, name in writer_types.items()
            }
            for frame in frames:
                depth = np.asarray(frame.depth, "<f4")
                messages = (
                    ros.camera(_OPTICAL, frame.time_ns),
                    ros.image(_OPTICAL, frame.time_ns, "32FC1", depth),
                )
                for (topic, name), message in zip(writer_types.items(), messages, strict=True):
                    data = ros.store.serialize_cdr(message, name)
                    writer.write(connections[topic], frame.time_ns, data)
                count += 1
        _put(Path(path), next(folder.glob("*.mcap")).read_bytes(), replace=replace)
    return count


def _counts(depth: NDArray[np.floating], unit: float) -> Image:
    counts = np.round(np.asarray(depth, float) / unit)
    if counts.max(initial=0.0) >= SATURATED:
        raise ValueError(
            f"depth must be at most {(SATURATED - 1) * unit:g} m at a unit of {unit:g} m, "
            f"got {np.max(depth):g} m"
        )
    return counts.astype("<u2")


def _put(path: Path, data: bytes, *, replace: bool) -> None:
    """Brings a recording to its place."""
    if replace:
        replace_file(path, data)
        return
    if path.exists() and path.stat().st_size > 0:
        raise ValueError(
            f"{path} is left as it is: what it records may not be had again; choose another name, "
            "or move it away"
        )
    _native.write_file(path, path.suffix.removeprefix("."), data)


@contextmanager
def _draft(path: str | PathLike[str]) -> Iterator[Path]:
    """A folder of its own in that of `path` for what is not whole yet; it is gone at the end."""
    with tempfile.TemporaryDirectory(prefix=".granulcal-", dir=Path(path).parent) as folder:
        yield Path(folder)
