"""Seeds of the fuzz targets: small recordings of each kind.

    pip install numpy mcap==1.6.0 pillow        # and those of generate_recordings.py
    python fuzz/seed_corpus.py

Checksums are left out of some: a byte that is changed then reaches the reader behind them.
"""

import io
import shutil
import sys
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from PIL import Image

ROOT = Path(__file__).parents[1]
RECORDINGS = ROOT / "crates/dataset/tests/data/recordings"
CORPUS = ROOT / "fuzz/corpus"

TOML = """width = 6
height = 4
fx = 9.0
fy = 9.0
cx = 2.5
cy = 1.5
depth_unit = 0.001
[segmentation]
border_px = 1
max_height = 0.2
[segmentation.height_threshold.automatic]
floor = 0.001
"""


def write(target: str, name: str, data: bytes) -> None:
    """Writes a seed of a target."""
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data)


def without_checksums(source: Path, *, chunking: bool, compression: CompressionType) -> bytes:
    """Returns the first message of each topic, without the text of the schemas."""
    out = io.BytesIO()
    writer = Writer(
        out,
        compression=compression,
        use_chunking=chunking,
        enable_crcs=False,
        enable_data_crcs=False,
    )
    writer.start()
    channels = {}
    with source.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.topic in channels:
                continue
            number = writer.register_schema(schema.name, schema.encoding, b"")
            channels[channel.topic] = writer.register_channel(
                channel.topic, channel.message_encoding, number
            )
            time = message.log_time
            writer.add_message(channels[channel.topic], time, message.data, time)
    writer.finish()
    return out.getvalue()


def png(pixels: np.ndarray) -> bytes:
    """Returns the pixels as a PNG."""
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "png")
    return out.getvalue()


def npz(save, **arrays: np.ndarray) -> bytes:
    """Returns the arrays as NumPy's `save` stores them."""
    out = io.BytesIO()
    save(out, **arrays)
    return out.getvalue()


def main() -> None:
    """Replaces the corpus."""
    shutil.rmtree(CORPUS, ignore_errors=True)
    sys.path.insert(0, str(RECORDINGS.parent))
    from generate_recordings import small_bag

    for compression in ("none", "lz4", "bz2"):
        write("bag", f"{compression}.bag", small_bag(compression))
    kinds = CompressionType
    for source, name, chunking, compression in (
        ("ros2_16uc1_none", "ros2_plain", False, kinds.NONE),
        ("ros2_32fc1_lz4", "ros2_lz4", True, kinds.LZ4),
        ("ros2_compressed_depth", "ros2_zstd", True, kinds.ZSTD),
        ("ros2_inverse_depth", "ros2_inverse", True, kinds.NONE),
        ("foxglove_raw", "foxglove_plain", False, kinds.NONE),
        ("foxglove_png", "foxglove_chunk", True, kinds.NONE),
    ):
        data = without_checksums(
            RECORDINGS / f"{source}.mcap", chunking=chunking, compression=compression
        )
        write("mcap", f"{name}.mcap", data)
    slope = (500 + np.arange(24).reshape(4, 6)).astype(np.uint16)
    colour = np.zeros((4, 6, 3), np.uint8)
    write("png_toml", "depth", TOML.encode() + b"\0" + png(slope))
    write("png_toml", "colour", TOML.encode() + b"\0" + png(colour))
    write("png_toml", "settings", b"[segmentation]\ndownsample = 2\n\0" + png(slope))
    unit = {"xres": np.float64(1), "yres": np.float64(2), "zres": np.int16(1)}
    for name, array in (
        ("f8", slope.astype("<f8")),
        ("i2_fortran", np.asfortranarray(slope.astype("<i2"))),
        ("f4_big", slope.astype(">f4")),
    ):
        data = npz(np.savez_compressed, depthmap=array, scale=np.array("mm"), **unit)
        write("npz", name, data)
    plain = npz(np.savez, depthmap=slope, scale=np.array(b"m"), **unit)
    write("npz", "stored", plain)
    total = sum(path.stat().st_size for path in CORPUS.rglob("*") if path.is_file())
    print(f"{total} bytes in {CORPUS}")


if __name__ == "__main__":
    main()
