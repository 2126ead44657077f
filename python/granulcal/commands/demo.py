"""The word `demo` of the command line."""

import argparse
from pathlib import Path
from typing import Any

from granulcal.paths import writes

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
        type=int,
        default=_POURS,
        help="pours to train on; fewer are faster and less sharp (default: %(default)s)",
    )
    parser.add_argument("--threads", type=int, help="pours at once (default: all cores)")
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from granulcal.demo import main

    return main(options.out, pours=options.pours, threads=options.threads)
