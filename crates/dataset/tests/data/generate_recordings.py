"""Recordings by other people's writers, which tests/messages.rs reads.

    pip install rosbags==0.11.9 mcap==1.6.0 mcap-protobuf-support==0.6.0 \
        foxglove-schemas-protobuf==0.4.0 numpy pillow
    python crates/dataset/tests/data/generate_recordings.py crates/dataset/tests/data/recordings

Every file shows the same scene, 12 x 8 pixels: `depth(i)` is frame i in millimetres.
"""

import io
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from mcap.writer import CompressionType, Writer
from mcap_protobuf.writer import Writer as ProtobufWriter
from PIL import Image
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore

WIDTH, HEIGHT, FRAMES = 12, 8, 3
K = [20.0, 0.0, 5.5, 0.0, 21.0, 3.5, 0.0, 0.0, 1.0]
P = [20.0, 0.0, 5.5, 0.0, 0.0, 21.0, 3.5, 0.0, 0.0, 0.0, 1.0, 0.0]
START = 1_700_000_000_000_000_000
STEP = 33_000_000


def depth(frame: int) -> np.ndarray:
    """Counts of a millimetre; a slope, a block on it, and a hole that wanders."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    counts = 500 + 2 * u + 3 * v + frame
    counts[2:5, 4:8] -= 40
    counts[(u + v) % 7 == frame] = 0
    return counts.astype("<u2")


def colour() -> np.ndarray:
    """Red grows to the right, green downwards, blue stays."""
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    return np.dstack([20 * u, 30 * v, 0 * u + 77]).astype(np.uint8)


def png(image: np.ndarray) -> bytes:
    out = io.BytesIO()
    Image.fromarray(image).save(out, "png")
    return out.getvalue()


class Messages:
    """Messages of one version of ROS."""

    def __init__(self, store: Stores) -> None:
        self.store = get_typestore(store)
        self.is_ros1 = store is Stores.ROS1_NOETIC

    def make(self, name: str, **fields):
        kind = self.store.types[name]
        if self.is_ros1 and name == "std_msgs/msg/Header":
            fields["seq"] = 0
        return kind(**fields)

    def header(self, frame: str, time: int):
        stamp = self.make("builtin_interfaces/msg/Time", sec=time // 10**9, nanosec=time % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def image(self, frame: str, time: int, encoding: str, pixels: np.ndarray):
        data = np.frombuffer(pixels.tobytes(), np.uint8)
        return self.make(
            "sensor_msgs/msg/Image",
            header=self.header(frame, time),
            height=HEIGHT,
            width=WIDTH,
            encoding=encoding,
            is_bigendian=0,
            step=len(data) // HEIGHT,
            data=data,
        )

    def compressed(self, frame: str, time: int, kind: str, data: bytes):
        return self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(frame, time),
            format=kind,
            data=np.frombuffer(data, np.uint8),
        )

    def camera(self, frame: str, time: int, scale: float = 1.0):
        roi = self.make(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0,
            y_offset=0,
            height=0,
            width=0,
            do_rectify=False,
        )
        names = ("D", "K", "R", "P") if self.is_ros1 else ("d", "k", "r", "p")
        lens = np.array(K) * [scale, 1, 1, 1, scale, 1, 1, 1, 1]
        values = (np.zeros(5), lens, np.eye(3).ravel(), np.array(P))
        return self.make(
            "sensor_msgs/msg/CameraInfo",
            header=self.header(frame, time),
            height=HEIGHT,
            width=WIDTH,
            distortion_model="plumb_bob",
            binning_x=0,
            binning_y=0,
            roi=roi,
            **dict(zip(names, values)),
        )


def bag(path: Path, compression: str, frames: int = FRAMES) -> None:
    """The layout of the RealSense viewer."""
    ros = Messages(Stores.ROS1_NOETIC)
    writer = BagWriter(path)
    # Small enough that each frame fills a chunk of its own.
    writer.chunk_threshold = 200
    if compression != "none":
        writer.set_compression(BagWriter.CompressionFormat[compression.upper()])
    with writer:
        connections = {}

        def write(topic: str, name: str, time: int, message) -> None:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=ros.store)
            writer.write(connections[topic], time, ros.store.serialize_ros1(message, name))

        sensor, stream = "/device_0/sensor_0", "/device_0/sensor_0/Depth_0"
        colours = "/device_0/sensor_1/Color_0"
        unit = ros.make("std_msgs/msg/Float32", data=0.0005)
        write(f"{sensor}/option/Depth Units/value", "std_msgs/msg/Float32", 1, unit)
        camera = "sensor_msgs/msg/CameraInfo"
        write(f"{stream}/info/camera_info", camera, 1, ros.camera("", 0))
        write(f"{colours}/info/camera_info", camera, 1, ros.camera("", 0, scale=2.0))
        turn = ros.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        for place, x in ((stream, 0.0), (colours, 0.025)):
            shift = ros.make("geometry_msgs/msg/Vector3", x=x, y=0.0, z=0.0)
            pose = ros.make("geometry_msgs/msg/Transform", translation=shift, rotation=turn)
            write(f"{place}/tf/0", "geometry_msgs/msg/Transform", 1, pose)
        for frame in range(frames):
            time = 10 + frame * STEP
            picture = ros.image("0", time, "mono16", 2 * depth(frame))
            write(f"{stream}/image/data", "sensor_msgs/msg/Image", time, picture)
            picture = ros.image("0", time, "rgb8", colour())
            write(f"{colours}/image/data", "sensor_msgs/msg/Image", time, picture)


def small_bag(compression: str) -> bytes:
    """One frame, for the corpus of the fuzz targets."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "small.bag"
        bag(path, compression, frames=1)
        return path.read_bytes()


def ros2(path: Path, compression: CompressionType, pictures: str) -> None:
    """A depth camera of ROS 2; `pictures` says how its images stand in the file."""
    ros = Messages(Stores.ROS2_HUMBLE)
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=700)
        writer.start(profile="ros2", library="generate_recordings")
        channels = {}

        def write(topic: str, name: str, time: int, message) -> None:
            if topic not in channels:
                text, _ = ros.store.generate_msgdef(name, ros_version=2)
                schema = writer.register_schema(name, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(ros.store.serialize_cdr(message, name))
            writer.add_message(channels[topic], time, data, time)

        optical = "camera_depth_optical_frame"
        for frame in range(FRAMES):
            time = START + frame * STEP
            write(
                "/camera/depth/camera_info",
                "sensor_msgs/msg/CameraInfo",
                time,
                ros.camera(optical, time),
            )
            counts = depth(frame)
            metres = np.where(counts == 0, np.nan, counts * 1e-3).astype("<f4")
            name, topic = "sensor_msgs/msg/Image", "/camera/depth/image_rect_raw"
            if pictures == "16UC1":
                message = ros.image(optical, time, "16UC1", counts)
            elif pictures == "32FC1":
                message = ros.image(optical, time, "32FC1", metres)
            else:
                name, topic = "sensor_msgs/msg/CompressedImage", f"{topic}/compressedDepth"
                kind, data = compressed_depth(pictures, counts)
                message = ros.compressed(optical, time, kind, data)
            write(topic, name, time, message)
            # Colour that is registered to the depth: the same frame, the same size.
            write(
                "/camera/aligned/image_raw",
                "sensor_msgs/msg/Image",
                time,
                ros.image(optical, time, "bgr8", np.ascontiguousarray(colour()[:, :, ::-1])),
            )
        writer.finish()


def compressed_depth(pictures: str, counts: np.ndarray) -> tuple[str, bytes]:
    """As image_transport's compressed and compressed_depth plugins write it."""
    if pictures == "png":
        return "16UC1; png compressed ", png(counts)
    if pictures == "compressedDepth":
        return "16UC1; compressedDepth png", struct.pack("<iff", 0, 0.0, 0.0) + png(counts)
    # Inverse depth: quantum 100, deepest 10 m, as compression_common.h has them.
    quantum, deepest = 100.0, 10.0
    a = quantum * (quantum + 1)
    b = 1 - a / deepest
    inverse = np.where(counts == 0, 0, a / np.maximum(counts * 1e-3, 1e-3) + b)
    data = struct.pack("<iff", 0, a, b) + png(np.round(inverse).astype("<u2"))
    return "32FC1; compressedDepth png", data


def foxglove(path: Path, compressed: bool) -> None:
    """Foxglove's own schemas."""
    with path.open("wb") as file:
        writer = ProtobufWriter(file)
        for frame in range(FRAMES):
            time = START + frame * STEP
            lens = CameraCalibration(frame_id="camera", width=WIDTH, height=HEIGHT, K=K, P=P)
            writer.write_message("/calibration", lens, time, time)
            counts = depth(frame)
            if compressed:
                picture = CompressedImage(frame_id="camera", data=png(counts), format="png")
            else:
                picture = RawImage(
                    frame_id="camera",
                    width=WIDTH,
                    height=HEIGHT,
                    encoding="16UC1",
                    step=2 * WIDTH,
                    data=counts.tobytes(),
                )
            writer.write_message("/depth", picture, time, time)
        writer.finish()


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    for compression in ("none", "lz4", "bz2"):
        bag(folder / f"realsense_{compression}.bag", compression)
    ros2(folder / "ros2_16uc1_none.mcap", CompressionType.NONE, "16UC1")
    ros2(folder / "ros2_16uc1_zstd.mcap", CompressionType.ZSTD, "16UC1")
    ros2(folder / "ros2_32fc1_lz4.mcap", CompressionType.LZ4, "32FC1")
    ros2(folder / "ros2_png.mcap", CompressionType.ZSTD, "png")
    ros2(folder / "ros2_compressed_depth.mcap", CompressionType.ZSTD, "compressedDepth")
    ros2(folder / "ros2_inverse_depth.mcap", CompressionType.ZSTD, "inverse")
    foxglove(folder / "foxglove_raw.mcap", compressed=False)
    foxglove(folder / "foxglove_png.mcap", compressed=True)


if __name__ == "__main__":
    main()
