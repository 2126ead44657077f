"""The word `infer`: the parameters of recordings, by granulcal-cli; plots and what was assumed here."""

import argparse
import contextlib
import importlib.util
import io
import sys
from typing import Any

from granulcal import _native
from granulcal.commands import observed
from granulcal.commands.counts import seed_number
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.commands.observed import add_observed
from granulcal.commands.reading import add_recordings, open_model, open_recordings, reading_words
from granulcal.paths import writes

__all__ = ["add"]

_DESCRIPTION = """\
Infer the parameters from recordings of formations, depth images each.

Of a model of what its scene observes (docs/scenes.md, "Observations") RECORDING
is a measurement of that: a drum's time-averaged picture (.bmp, .png; --width),
a run-out file (.txt; --fps), a discharge curve (.csv; --series), or numbers of
your own, as a table with the columns statistic and value (.csv) or as
`simulate --json` prints them (.json).
"""


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "infer the parameters from recordings"
    parser = commands.add_parser(
        "infer",
        help=text,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_recordings(parser)
    add_observed(parser)
    parser.add_argument("--border", type=int, help="ignore a frame of so many pixels")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument(
        "--samples", type=int, help="print so many draws in the JSON (default: none)"
    )
    parser.add_argument("--seed", type=seed_number, help="seed of the draws (default: 0)")
    parser.add_argument(
        "-o", "--out", type=writes("json"), help="write JSON with samples to this file"
    )
    parser.add_argument("--plot", type=writes("figure"), help="write the pair plot to this file")
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    """Posterior and table are by granulcal-cli, so that both say the same."""
    from granulcal.bayessim.storage.model_document import read_model_document
    from granulcal.starter.models import model_named

    if options.plot is not None and importlib.util.find_spec("torch") is None:
        raise ModuleNotFoundError("--plot needs PyTorch")
    model = model_named(str(options.model))
    _, document = read_model_document(model)
    if observed.is_of_observed(document):
        return observed.run(options, model, document)
    observed.refuse(options)
    flags = ["-q"] * options.quiet + ["-v"] * options.verbose
    words = ["granulcal", *flags, "infer", str(model), *map(str, options.recording)]
    words += reading_words(options)
    for name in ("scene", "border", "samples", "seed", "out"):
        if getattr(options, name) is not None:
            words.append(f"--{name}={getattr(options, name)}")
    if options.json:
        words.append("--json")
    code = _native.run_cli(words)
    if not options.json and code in (DONE, UNHEALTHY):
        _say_assumed(document)
    if options.plot is not None and code in (DONE, UNHEALTHY):
        _plot(options, code)
    return code


def _say_assumed(document: dict[str, Any]) -> None:
    """Says below the table what nobody inferred."""
    from granulcal.assumed import assumed
    from granulcal.prior import Prior

    if line := assumed(document["scene_toml"], Prior.from_toml(document["prior_toml"])):
        print(line, flush=True)


def _plot(options: argparse.Namespace, code: int) -> None:
    """Draws the posterior that was told; none where none was given."""
    from granulcal.measured.plausible import violations
    from granulcal.pours.scene import Scene

    # Which statistics it may be of, `infer` has said.
    model = open_model(options, of_images=False)
    with contextlib.redirect_stderr(io.StringIO()):
        # What is lost of the recordings is told already.
        recordings = open_recordings(options)
    matched: dict[str, Any] = {}
    if model.scene_toml is not None:
        scene = Scene.from_toml(model.scene_toml)
        matched |= scene.reading
        impossible = code == UNHEALTHY and violations(
            scene, model.prior, recordings, options.recording
        )
        if impossible:
            print("no --plot: no posterior is given", file=sys.stderr)
            return
    if options.border is not None:
        matched["border_px"] = options.border
    # By name: the model may be of some of them.
    x = [recording.formation(**matched).statistics() for recording in recordings]
    title = "" if model.misfit(x).is_inside else "OUTSIDE THE MODEL: its best compromise"
    model.posterior(x).pair_plot(options.plot, title=title)
