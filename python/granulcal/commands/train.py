"""The word `train`: BayesSim on a data set, checked on pours left out of a fit."""

import argparse
import sys
from typing import Any

from granulcal.commands.counts import seed_number
from granulcal.commands.dry_run import add_dry_run, say_seconds
from granulcal.commands.exit_code import DONE
from granulcal.commands.reading import TRAINING
from granulcal.paths import READS, writes
from granulcal.progress import duration

__all__ = ["add"]


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "train BayesSim on a data set and check its calibration on pours left out of it"
    more = (
        "train BayesSim on a data set and check its calibration on pours left out of it in turn; "
        "the emulator's form is chosen by the same pours, so that `check --data` with others is "
        "stricter"
    )
    parser = commands.add_parser("train", help=text, description=more)
    parser.add_argument("data", type=READS, help="folder of `generate`, or one Parquet file")
    parser.add_argument(
        "-o", "--out", type=writes("model"), required=True, help="folder of the model"
    )
    parser.add_argument(
        "--seed", type=seed_number, default=0, help="seed of the training (default: 0)"
    )
    parser.add_argument(
        "--method",
        choices=("auto", "emulated", "distilled", "mdrff", "plain"),
        default="auto",
        help="emulated: learn the statistics of a material; mdrff: learn the material of "
        "statistics; auto (default): the average of these two that says most about held-out "
        "pours; distilled: a network that imitates the emulator; plain: the paper's recipe",
    )
    parser.add_argument(
        "--components",
        type=int,
        nargs="+",
        metavar="K",
        help="Gaussians in the mixture of each of the network's five members (default: 5); of "
        "several numbers the one of the best validation loss is kept",
    )
    add_dry_run(parser, by="its first steps")
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run, tells=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.bayessim import BayesSim
    from granulcal.pours.dataset import Dataset
    from granulcal.progress import shown

    data = Dataset.load(options.data)
    told = options.told
    if data.missing:
        print(
            f"warning: {options.data} has {len(data)} rows, {data.missing} more were asked for: a "
            "batch that was stopped, or one of several shards",
            file=sys.stderr,
        )
    settings: dict[str, Any] = {}
    if options.components:
        settings["components"] = tuple(options.components)
    if options.dry_run:
        return _say_how_long(options, data, settings)
    with shown():
        model = BayesSim.fit(data, seed=options.seed, method=options.method, **settings)
    model.save(options.out)
    data.save(options.out / TRAINING)
    print(f"model written to {options.out}")
    checked = None if model.calibration is None else model.calibration.is_calibrated
    told |= {
        "model": str(options.out),
        "pours": len(data),
        "missing": data.missing,
        "calibrated": checked,
    }
    return DONE


def _say_how_long(options: argparse.Namespace, data: Any, settings: dict[str, Any]) -> int:
    from granulcal.bayessim.training.time_needed import training_time

    took = training_time(data, seed=options.seed, method=options.method, **settings)
    text = f"emulator {duration(took.emulator)}, "
    text += f"network at most {duration(took.network)}, " if took.network else ""
    text += "the check of its intervals apart"
    told = {"emulator_s": took.emulator, "network_s": took.network}
    return say_seconds(options, took.seconds, text, **told)
