"""The word `film`: a pour as an animated GIF or an MP4."""

import argparse
import json
import sys
from typing import Any

from granulcal.commands.counts import seed_number
from granulcal.commands.setting import setting
from granulcal.paths import READS, writes

__all__ = ["add"]

_TEXT = "pour a scene and write an animated GIF or an MP4 of it"
_DESCRIPTION = """\
Pour a scene and write an animated GIF or an MP4: grains as balls, walls at rest
as lines, half as fast as it was.

  granulcal film funnel -o pour.gif
  granulcal film scene.toml --set funnel.height=0.06 --slow 4 -o pour.mp4

An MP4 needs the extra granulcal[film]. `simulate --mcap` writes a film for
Foxglove, with depth images and walls; examples/foxglove.json is a layout for
it.
"""


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser(
        "film",
        help=_TEXT,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", type=READS, help="TOML, or the word funnel or drop")
    parser.add_argument(
        "-o", "--out", type=writes("film"), required=True, help="the film, .gif or .mp4"
    )
    parser.add_argument("--seed", type=seed_number, default=0, help="seed of the pour (default: 0)")
    parser.add_argument("--fps", type=float, default=15.0, help="frames a second (default: 15)")
    parser.add_argument(
        "--slow", type=float, default=2.0, help="seconds of film for one of the pour (default: 2)"
    )
    parser.add_argument(
        "--most-frames", type=int, default=120,
        help="the film ends there, with the pour's last frame (default: 120)",
    )  # fmt: skip
    parser.add_argument("--width", type=int, default=480, help="pixels (default: 480)")
    parser.add_argument(
        "--set", action="append", default=[], type=setting, metavar="PATH=NUMBER",
        help="another number of the scene; may be repeated",
    )  # fmt: skip
    parser.add_argument("--preset", help="settings of the solver, in place of the scene's")
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from granulcal.pours.film import film
    from granulcal.pours.scene import Scene

    scene = Scene.named(options.scene)
    if options.preset is not None:
        scene = scene.with_(preset=options.preset)
    scene = scene.with_(dict(options.set))
    frames = film(
        scene,
        options.out,
        seed=options.seed,
        fps=options.fps,
        slow=options.slow,
        width=options.width,
        most_frames=options.most_frames,
        progress=_line if sys.stderr.isatty() else None,
        dropped=lambda count: _tell_dropped(count, options.most_frames),
    )
    if options.json:
        print(json.dumps({"file": str(options.out), "frames": frames}))
    else:
        print(f"{options.out}: {frames} frames")
    return 0


def _tell_dropped(count: int, most: int) -> None:
    print(
        f"note: {count} frames of the pour are left out before the last one, for the film has at "
        f"most {most}: --most-frames sets another number",
        file=sys.stderr,
    )


def _line(time: float) -> None:
    print(f"\r{time:.2f} s poured", end="", file=sys.stderr, flush=True)
