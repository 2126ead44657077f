"""The word `export`: materials, posteriors, scenes and beds for other simulators."""

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granulcal.commands.counts import seed_number
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.commands.setting import require_apart, setting
from granulcal.paths import READS, writes

if TYPE_CHECKING:
    from granulcal.design.posterior_file import PosteriorDraws

__all__ = ["add"]

_TEXT = "write a material, a posterior, a scene or a bed of grains for another simulator"
_DESCRIPTION = """\
Write what was found in the words of another simulator, with each engine's
conventions: rolling friction as a ratio or as a length, restitution as a
dashpot, what has no counterpart said in the file (docs/export.md).

  granulcal export material scene.toml --to mujoco -o material.xml
  granulcal export posterior posterior.json scene.toml --to lammps -o materials
  granulcal export scene scene.toml --to liggghts -o pour
  granulcal export bed scene.toml --to vtk -o pile.vtk
  granulcal export frames scene.toml --to vtk --every 0.02 -o frames

posterior.json is what `infer -o` or `calibrate` wrote; the folder of the latter
will do. `scene` writes a whole pour, whose README.txt says how to run it, `bed`
the grains at rest, `frames` those of our own pour over time, for ParaView
(frames.vtk.series) or Blender. A file that granulcal did not export is not
replaced. Exit code 3: the posterior is outside its model, or the pour of a bed
did not come to rest.
"""
_ENGINES = ("lammps", "liggghts", "yade", "mujoco", "chrono", "isaac", "gazebo", "newton")
# What is wrong with pours whose grains are not at rest on the ground, by status.
_UNSETTLED = {
    "horizon": "its grains still move; a longer end.horizon lets them come to rest",
    "jammed": "grains wait in the funnel",
    "unhealthy": "the simulation lost its accuracy; try another seed",
}
_POINTS = ("vtk", "ply", "csv")
_FORMATS = ("lammps-data", *_POINTS, "mjcf", "sdf", "urdf")


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser(
        "export",
        help=_TEXT,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.set_defaults(run=lambda _: parser.print_help() or 2)
    words = parser.add_subparsers(title="what to export", metavar="WHAT", dest="word")
    _add_material(words)
    _add_posterior(words)
    _add_scene(words)
    _add_bed(words)
    _add_frames(words)


def _add_common(parser: argparse.ArgumentParser, out: str, but: str = "") -> None:
    parser.add_argument("-o", "--out", type=writes("export"), required=True, help=out)
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=setting,
        metavar="PATH=NUMBER",
        help=f"another number of the scene, as material.restitution=0.5{but}; may be repeated",
    )
    parser.add_argument("--json", action="store_true", help="print JSON instead of a list")


def _add_engine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--to", required=True, choices=_ENGINES, metavar="ENGINE", help=", ".join(_ENGINES)
    )
    parser.add_argument(
        "--young",
        type=float,
        metavar="PA",
        help="Young's modulus, 1e4 to 1e12 (default: 3e6 at 1300 kg/m^3, "
        "in proportion to the density); lammps, liggghts and yade alone",
    )


def _add_material(words: Any) -> None:
    text = "the material of a scene"
    parser = words.add_parser("material", help=text, description=text)
    parser.add_argument("scene", type=READS, help="TOML, or the word funnel or drop")
    _add_engine(parser)
    _add_common(parser, "the file")
    parser.set_defaults(run=_material)


def _add_posterior(words: Any) -> None:
    text = "the most probable material of a posterior, and draws of it"
    parser = words.add_parser("posterior", help=text, description=text)
    parser.add_argument(
        "posterior", type=READS, help="JSON of `infer -o`, or that or the folder of `calibrate`"
    )
    parser.add_argument("scene", type=READS, help="TOML, or the word funnel or drop")
    parser.add_argument("--draws", type=int, default=0, help="files of draws (default: none)")
    _add_engine(parser)
    _add_common(parser, "the folder", ", and none that the posterior has")
    parser.set_defaults(run=_posterior)


def _add_scene(words: Any) -> None:
    text = "a whole pour: grains at the start, walls, material, until it rests"
    parser = words.add_parser("scene", help=text, description=text)
    parser.add_argument("scene", type=READS, help="TOML, or the word funnel or drop")
    parser.add_argument("--posterior", type=READS, help="take the most probable material of this")
    parser.add_argument(
        "--seed", type=seed_number, default=0, help="seed of the start (default: 0)"
    )
    _add_engine(parser)
    _add_common(parser, "the folder", ", and none that --posterior has")
    parser.set_defaults(run=_scene)


def _add_bed(words: Any) -> None:
    text = "grains at rest: those of a pour, or of a file"
    parser = words.add_parser("bed", help=text, description=text)
    parser.add_argument("scene", type=READS, help="TOML, or the word funnel or drop")
    parser.add_argument("--to", required=True, choices=_FORMATS, help="the format")
    parser.add_argument(
        "--positions", type=READS, help="centres [m] of `simulate --positions`, instead of a pour"
    )
    parser.add_argument(
        "--seed",
        type=seed_number,
        default=0,
        help="seed of the pour, of --positions too (default: 0)",
    )
    _add_common(parser, "the file")
    parser.set_defaults(run=_bed)


def _add_frames(words: Any) -> None:
    text = "grains over time: a pour as a file for each frame"
    parser = words.add_parser("frames", help=text, description=text)
    parser.add_argument("scene", type=READS, help="TOML, or the word funnel or drop")
    parser.add_argument("--to", required=True, choices=_POINTS, help="the format")
    parser.add_argument(
        "--every", type=float, default=0.02, metavar="S",
        help="simulated seconds between two frames (default: 0.02)",
    )  # fmt: skip
    parser.add_argument("--seed", type=seed_number, default=0, help="seed of the pour (default: 0)")
    _add_common(parser, "the folder")
    parser.set_defaults(run=_frames)


def _loaded(options: argparse.Namespace) -> Any:
    from granulcal.pours.scene import Scene

    return Scene.named(options.scene).with_(dict(options.set))


def _told(options: argparse.Namespace, files: list[Path], is_whole: bool = True) -> int:
    names = [str(path) for path in files]
    print(json.dumps({"files": names}, indent=1) if options.json else "\n".join(names))
    return DONE if is_whole else UNHEALTHY


def _material(options: argparse.Namespace) -> int:
    from granulcal.export import export_material

    file = export_material(_loaded(options), options.to, options.out, young=options.young)
    return _told(options, [file])


def _posterior(options: argparse.Namespace) -> int:
    from granulcal.design.posterior_file import PosteriorDraws
    from granulcal.export import export_posterior

    if options.draws < 0:
        raise ValueError(f"--draws must be at least 0, got {options.draws}")
    found = PosteriorDraws.load(options.posterior)
    require_apart(options.set, found, options.posterior)
    if options.draws > len(found.samples):
        raise ValueError(
            f"--draws must be at most {len(found.samples)}, the samples in {options.posterior}; "
            f"got {options.draws}"
        )
    files = export_posterior(
        found.names,
        found.mode,
        found.samples[: options.draws],
        found.on(_loaded(options)),
        options.to,
        options.out,
        young=options.young,
        source=_source(found, options.posterior),
    )
    return _told(options, files, found.is_inside)


def _source(found: "PosteriorDraws", file: Path) -> list[str]:
    """Returns what a head says of a posterior: its file, and what its prior fixed."""
    from granulcal.export.mark import plain

    fixed = f"; fixed by its prior: {', '.join(found.fixed)}" if found.fixed else ""
    return [f"posterior: {plain(file.name)}{fixed}"]


def _scene(options: argparse.Namespace) -> int:
    from granulcal.design.posterior_file import PosteriorDraws
    from granulcal.export import export_scene

    scene, is_inside, source = _loaded(options), True, []
    if options.posterior is not None:
        found = PosteriorDraws.load(options.posterior)
        require_apart(options.set, found, options.posterior)
        scene, is_inside = found.at_mode(scene), found.is_inside
        taken = f"the most probable of a posterior: {', '.join(found.names)}"
        source = [taken, *_source(found, options.posterior)]
    files = export_scene(
        scene, options.to, options.out, seed=options.seed, young=options.young, source=source
    )
    return _told(options, files, is_inside)


def _bed(options: argparse.Namespace) -> int:
    from granulcal.arrays import read_array
    from granulcal.export import export_bed
    from granulcal.export.bed import FORMATS
    from granulcal.export.mark import require_ending, require_replaceable
    from granulcal.export.setup import Setup
    from granulcal.pours.simulate import simulate

    scene = _loaded(options)
    # What cannot be exported, and where it cannot be written, is told before a pour.
    Setup.of_bed(scene, options.to, options.seed)
    require_ending(options.out, options.to, FORMATS)
    if options.to != "csv":
        require_replaceable([options.out])
    status = "at_rest"
    if options.positions is not None:
        positions, radii = read_array(options.positions), None
    else:
        pour = simulate(scene, seed=options.seed)
        positions, radii = pour.positions, pour.radii
        status = pour.status
    if status in _UNSETTLED:
        told = _UNSETTLED[status]
        print(f"warning: the pour ended as {status}: {told}", file=sys.stderr)
    file = export_bed(scene, positions, radii, options.to, options.out, seed=options.seed)
    return _told(options, [file], status not in _UNSETTLED)


def _frames(options: argparse.Namespace) -> int:
    from granulcal.export.frames import export_frames, require_frames
    from granulcal.pours.simulate import simulate

    scene = _loaded(options)
    require_frames(scene, options.to)
    pour = simulate(scene, seed=options.seed, every=options.every)
    return _told(options, export_frames(pour.trajectory, options.to, options.out))
