"""The word `demo` of the command line."""

import argparse
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

from granulcal.commands.counts import pour_count, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.paths import writes
from granulcal.progress import shown

__all__ = ["add"]

_POURS = 200


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "the whole job on a recording with a known truth"
    parser = commands.add_parser("demo", help=text, description=text)
    parser.add_argument(
        "--out", type=writes("report"), default=Path("demo"), help="folder (default: demo)"
    )
    parser.add_argument(
        "--pours",
        type=pour_count,
        default=_POURS,
        help="pours to train on; fewer are faster and less sharp (default: %(default)s)",
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    add_dry_run(parser)
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run, goes_on=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.demo import demo_scene, main
    from granulcal.prior import Prior

    if options.dry_run:
        return say_how_long(options, demo_scene(), Prior.default(), options.pours)
    aside = contextlib.redirect_stdout(sys.stderr) if options.json else contextlib.nullcontext()
    with aside, shown():
        code = main(options.out, pours=options.pours, threads=options.threads)
    if not options.json:
        return code
    print(json.dumps({"report": str(options.out / "report.html")}))
    return code
