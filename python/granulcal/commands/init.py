"""The words `init` and `sample`: a folder to begin with, and recordings of a known truth for it."""

import argparse
import json
import sys
from pathlib import Path
from shlex import quote
from typing import Any

from granulcal.commands.counts import seed_number
from granulcal.commands.setting import setting
from granulcal.paths import READS, RECORDING, writes
from granulcal.warned import warn

__all__ = ["add"]

_INIT = """\
Write a folder to begin with: scene.toml, prior.toml, camera.toml and
loop.toml, each with comments.

  granulcal init couscous                      the funnel under a RealSense D435
  granulcal init couscous --recording my.bag   lens, height and noise of my.bag
  granulcal init couscous --scene drop --set grains.count=300 --preset fast

--recording reads the lens, its distance from the ground and the noise of the
ground, so that simulated images are as the recorded ones. What stands in the
files is checked when it is used: change it.
"""
_SAMPLE = """\
Pour a material whose truth is known in the scene of a folder, and record it
with the folder's camera.

  granulcal init couscous
  granulcal sample couscous

Written to the folder: couscous.bag, .mcap and .png, wall.bag, pours/*.png and
truth.json. The .bag is laid out as the RealSense viewer saves it, the .mcap as
ros2 bag does; both need the extra granulcal[ros]. The camera is tilted and
noisy as a stereo camera is. pours/ has the recordings that loop.toml asks for.
truth.json says what was poured; hide it from yourself as you like.
"""


def add(commands: Any) -> None:
    """Adds the words to the command line."""
    _add_init(commands)
    _add_sample(commands)


def _add_init(commands: Any) -> None:
    parser = commands.add_parser(
        "init",
        help="write a folder to begin with: scene, prior, camera and task, with comments",
        description=_INIT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", type=writes("folder"), help="made if it does not exist")
    parser.add_argument(
        "--scene", choices=("funnel", "drop"), default="funnel", help="built-in (default: funnel)"
    )
    parser.add_argument("--recording", type=RECORDING, help="depth recording to take the lens from")
    parser.add_argument(
        "--camera", type=READS, help="TOML of the camera, if the recording is a PNG without it"
    )
    parser.add_argument(
        "--preset",
        choices=("fast", "default", "accurate"),
        help="of the solver (default: the scene's)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=setting,
        metavar="PATH=NUMBER",
        help="another number in scene.toml, as grains.count=300; may be repeated",
    )
    parser.add_argument("--force", action="store_true", help="overwrite files that are there")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a list")
    parser.set_defaults(run=_init)


def _add_sample(commands: Any) -> None:
    parser = commands.add_parser(
        "sample",
        help="record a pour of a known material with a simulated camera, as .bag, .mcap and .png",
        description=_SAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "folder",
        type=writes("folder"),
        nargs="?",
        default=Path(),
        help="of `init` (default: this one)",
    )
    parser.add_argument(
        "--seed", type=seed_number, help="seed of the pours and of the noise (default: 20231)"
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=setting,
        metavar="PATH=NUMBER",
        help="another hidden material, as material.restitution=0.6; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a list")
    parser.set_defaults(run=_sample)


def _init(options: argparse.Namespace) -> int:
    from granulcal.starter.folder import D435, FILES, doubt_of_pixels, lens_of, write_folder

    lens = D435 if options.recording is None else lens_of(options.recording, options.camera)
    changes: dict[str, float | str] = dict(options.set)
    if options.preset is not None:
        changes["preset"] = options.preset
    scene = write_folder(
        options.folder,
        scene=options.scene,
        lens=lens,
        changes=changes,
        force=options.force,
    )
    files = [str(options.folder / name) for name in FILES]
    doubts = doubt_of_pixels(lens, scene.get("grains.diameter"))
    warn(doubts)
    if options.json:
        print(json.dumps({"files": files, "scene": scene.name, "warnings": doubts}, indent=1))
        return 0
    print(f"written: {', '.join(files)}")
    print(f"next: granulcal simulate {quote(str(options.folder / 'scene.toml'))}")
    if options.recording is None:
        print(f"no recording yet? granulcal sample {quote(str(options.folder))}")
    return 0


def _sample(options: argparse.Namespace) -> int:
    from granulcal.pours.scene import Scene
    from granulcal.starter.folder import CONDITIONS
    from granulcal.starter.samples import HIDDEN, write_samples

    file = options.folder / "scene.toml"
    if not file.exists():
        raise FileNotFoundError(f"{file} is not there; `granulcal init {options.folder}` writes it")
    scene = Scene.load(file)
    path = "funnel.height" if scene.has("funnel.height") else "start.height"
    material = scene.with_material(HIDDEN).with_(dict(options.set)).material
    more = {} if options.seed is None else {"seed": options.seed}
    found = write_samples(
        options.folder,
        material=material,
        conditions={name: {path: value} for name, value in CONDITIONS.items()},
        **more,
    )
    if options.json:
        paths = {"files": list(map(str, found.paths)), "missing": list(map(str, found.missing))}
        print(json.dumps(paths, indent=1))
    else:
        print("\n".join(map(str, found.paths)))
    if found.missing:
        names = ", ".join(path.name for path in found.missing)
        print(f"note: {names} left out: pip install 'granulcal[ros]'", file=sys.stderr)
    return 0
