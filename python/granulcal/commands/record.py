"""The word `record`: depth frames of a camera at this computer."""

import argparse
import json
from typing import Any

from granulcal.paths import writes

__all__ = ["add"]

_TEXT = "record depth frames of a RealSense, or of a topic of ROS 2"
_DESCRIPTION = """\
Record depth frames, with their lens, of grains at rest or of the empty table.

  granulcal record couscous.bag                a RealSense at this computer
  granulcal record couscous.mcap --topic /camera/depth/image_rect_raw

--topic is of a running node of ROS 2, of which a sourced installation is
needed. The RealSense needs pyrealsense2 (pip install 'granulcal[realsense]').
"""


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser(
        "record",
        help=_TEXT,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("out", type=writes("messages"), help=".bag or .mcap")
    parser.add_argument("--frames", type=int, default=10, help="how many (default: 10)")
    parser.add_argument("--topic", help="depth topic of ROS 2, in place of a RealSense")
    parser.add_argument("--camera-topic", help="topic of its lens (default: camera_info beside it)")
    parser.add_argument("--width", type=int, default=640, help="of a RealSense (default: 640)")
    parser.add_argument("--height", type=int, default=480, help="of a RealSense (default: 480)")
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from granulcal.measured.live import RealSense, Ros2, record, require_recordable

    # Before a camera is opened, which takes seconds and may be missing.
    require_recordable(options.out, options.frames)
    if options.topic is not None:
        source = Ros2(options.topic, options.camera_topic)
    else:
        source = RealSense(width=options.width, height=options.height)
    count = record(source, options.out, frames=options.frames)
    if options.json:
        print(json.dumps({"file": str(options.out), "frames": count}))
    else:
        print(f"{options.out}: {count} frames; look at it: granulcal inspect {options.out}")
    return 0
