"""The word `report`: infer, simulate the result and write one HTML page."""

import argparse
import shlex
import sys
from typing import Any

from granulcal.commands.counts import pour_count, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.commands.exit_code import UNHEALTHY
from granulcal.commands.reading import (
    TRAINING,
    add_recordings,
    exit_code_of,
    open_model,
    open_recordings,
    outside,
    reading_words,
    told_outside,
)
from granulcal.paths import READS, writes
from granulcal.progress import shown
from granulcal.warned import warn

__all__ = ["add"]


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "infer, simulate the result and write one HTML page"
    parser = commands.add_parser("report", help=text, description=text)
    add_recordings(parser)
    parser.add_argument("-o", "--out", type=writes("html"), required=True, help="the HTML file")
    parser.add_argument("--seeds", type=pour_count, default=3, help="pours to compare (default: 3)")
    parser.add_argument(
        "--draws",
        type=pour_count,
        default=8,
        help="pours at draws of the posterior, for the band of the profile (default: 8)",
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    parser.add_argument(
        "--data", type=READS, help=f"training data (default: {TRAINING} in the model's folder)"
    )
    add_dry_run(parser)
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run, tells=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.calibrate import calibrate, require_same_scene
    from granulcal.measured.plausible import doubts, violations
    from granulcal.pours.dataset import Dataset
    from granulcal.pours.left_out import LeftOut
    from granulcal.starter.models import model_named

    if options.seeds < 1:
        raise ValueError(f"--seeds must be at least 1, got {options.seeds}")
    if options.draws < 0:
        raise ValueError(f"--draws must be at least 0, got {options.draws}")
    model = open_model(options)
    folder = model_named(options.model)
    training = folder / TRAINING if options.data is None else options.data
    if options.data is None and not training.exists():
        told = "give some of its scene with --data, as `granulcal generate` makes them"
        raise FileNotFoundError(f"{folder} came without its training pours: {told}")
    data = Dataset.load(training)
    require_same_scene(model, data.scene)
    if options.dry_run:
        # At the mode, at the prior's mean, at draws.
        pours = 2 * options.seeds + options.draws
        return say_how_long(options, data.scene, model.prior, pours)
    recordings = open_recordings(options)
    if impossible := violations(data.scene, model.prior, recordings, options.recording):
        options.told |= told_outside(options, impossible)
        print(outside(impossible))
        return UNHEALTHY
    doubtful = doubts(data.scene, model.prior, recordings, options.recording)
    warn(doubtful)
    names = " ".join(str(path) for path in options.recording)
    words = ["granulcal", "report", str(options.model), *map(str, options.recording)]
    words += reading_words(options)
    words += ["-o", str(options.out), "--seeds", str(options.seeds)]
    words += ["--draws", str(options.draws)]
    if options.data is not None:
        words += ["--data", str(options.data)]
    with shown():
        found = calibrate(
            model,
            data,
            recordings,
            report=options.out,
            seeds=options.seeds,
            draws=options.draws,
            threads=options.threads,
            title=f"Calibration from {names}",
            summary=f"Parameters of the scene {data.scene.name!r}, inferred from {names} "
            f"with a model trained on {len(data)} pours.",
            command=shlex.join(words),
            notes=doubtful,
        )
    if not found.misfit.is_inside:
        print(found.misfit)
    print(found.report)
    left_out = LeftOut.of_pours([*found.pours, *found.prior_pours])
    if left_out.total:
        print(f"note: of the pours on the page cannot be used: {left_out}", file=sys.stderr)
    options.told |= {
        "report": str(found.report),
        "inside_model": {"is_inside": found.misfit.is_inside, "p_value": found.misfit.p_value},
        "left_out": left_out.to_dict(),
        "warnings": doubtful,
    }
    return exit_code_of(recordings, not left_out.unhealthy and found.misfit.is_inside)
