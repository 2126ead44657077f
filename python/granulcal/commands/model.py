"""The word `model`: a model of a built-in scene, made once and found by its name."""

import argparse
import contextlib
import json
import sys
from typing import Any

from granulcal.commands.counts import seed_number, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.paths import READS, writes

__all__ = ["add"]

_TEXT = "make a model of a built-in scene once, for `infer funnel RECORDING`"
_DESCRIPTION = """\
Simulate a built-in scene, train a model on it and keep it where `infer` finds
it by the scene's name:

  granulcal model funnel                 1000 pours, 20 to 25 minutes on 2 cores
  granulcal infer funnel couscous.bag

It goes on after a stop. Or the same pours, made elsewhere or long ago:

  granulcal generate funnel default -n 1000 -o pours
  granulcal model funnel --data pours

It is kept in the user's cache ($GRANULCAL_CACHE sets another place) with its
training data. A model that was made by another version of the simulator is not
taken, whatever its name.
"""


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser(
        "model",
        help=_TEXT,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", choices=("funnel", "drop"), help="built-in scene")
    parser.add_argument("-n", "--pours", type=int, default=1000, help="pours (default: 1000)")
    parser.add_argument(
        "-o", "--out", type=writes("model"), help="folder of the model (default: the cache)"
    )
    parser.add_argument(
        "--data",
        type=READS,
        help="folder of `generate` with this scene and the default prior, in place of new pours",
    )
    parser.add_argument(
        "--compact",
        action="store_true",
        help="without the training pours, which `report` wants: the form that ships",
    )
    parser.add_argument(
        "--seed", type=seed_number, default=0, help="seed of everything (default: 0)"
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    add_dry_run(parser)
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run, goes_on=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.starter.make_model import make_model

    if options.dry_run:
        from granulcal.pours.scene import Scene
        from granulcal.prior import Prior

        pours = 0 if options.data is not None else options.pours
        return say_how_long(options, Scene.built_in(options.scene), Prior.default(), pours)
    # What is told on the way goes to stderr: stdout has the folder alone.
    with contextlib.redirect_stdout(sys.stderr):
        folder = make_model(
            options.scene,
            pours=options.pours,
            out=options.out,
            data=options.data,
            compact=options.compact,
            seed=options.seed,
            threads=options.threads,
            say=lambda text: print(text, flush=True),
        )
    print(json.dumps({"model": str(folder)}) if options.json else folder)
    return 0
