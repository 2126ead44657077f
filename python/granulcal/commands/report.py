"""The word `report`: infer, simulate the result and write one HTML page."""

import argparse
import shlex
import sys
from typing import TYPE_CHECKING, Any

from granulcal.commands import observed
from granulcal.commands.counts import pour_count, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.commands.exit_code import UNHEALTHY
from granulcal.commands.misfit import odd_pour_of, print_misfit
from granulcal.commands.other_prior import difference
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

if TYPE_CHECKING:
    from granulcal.calibrate import Calibrated
    from granulcal.pours.dataset import Dataset

__all__ = ["add"]


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "infer, simulate the result and write one HTML page"
    more = f"{text}; of a model of what its scene observes, too, as `infer` takes its measurements"
    parser = commands.add_parser("report", help=text, description=more)
    add_recordings(parser)
    observed.add_observed(parser)
    parser.add_argument("-o", "--out", type=writes("html"), required=True, help="the HTML file")
    parser.add_argument("--seeds", type=pour_count, default=3, help="pours to compare (default: 3)")
    parser.add_argument(
        "--draws",
        type=pour_count,
        default=8,
        help="pours at draws of the posterior, for the band of a formation's profile (default: 8)",
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    parser.add_argument(
        "--data", type=READS, help=f"training data (default: {TRAINING} in the model's folder)"
    )
    add_dry_run(parser)
    parser.add_argument("--json", action="store_true", help="print JSON at the end")
    parser.set_defaults(run=_run, tells=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.bayessim.storage.model_document import read_model_document
    from granulcal.bayessim.training.own_pours import require_own_pours
    from granulcal.calibrate import require_same_scene
    from granulcal.pours.dataset import Dataset
    from granulcal.starter.models import model_named

    if options.seeds < 1:
        raise ValueError(f"--seeds must be at least 1, got {options.seeds}")
    if options.draws < 0:
        raise ValueError(f"--draws must be at least 0, got {options.draws}")
    folder = model_named(options.model)
    _, document = read_model_document(folder)
    is_of_observed = observed.is_of_observed(document)
    # What was measured is read before PyTorch is loaded.
    measured = observed.read_measured(options, document) if is_of_observed else []
    if not is_of_observed:
        observed.refuse(options)
    model = open_model(options, of_images=not is_of_observed)
    training = folder / TRAINING if options.data is None else options.data
    if options.data is None and not training.exists():
        told = "give some of its scene with --data, as `granulcal generate` makes them"
        raise FileNotFoundError(f"{folder} came without its training pours: {told}")
    data = Dataset.load(training)
    require_same_scene(model, data.scene)
    unlike = _unlike(options, model, data)
    if options.data is None:
        require_own_pours(model, data, training)
    if options.dry_run:
        # At the mode, at the prior's mean, at draws.
        pours = 2 * options.seeds + (0 if is_of_observed else options.draws)
        return say_how_long(options, data.scene, model.prior, pours)
    warn(unlike)
    if is_of_observed:
        return _of_observed(options, model, data, measured, unlike)
    return _of_images(options, model, data, unlike)


def _unlike(options: argparse.Namespace, model: Any, data: "Dataset") -> list[str]:
    """Returns that the pours of --data are of another prior than the model, if they are."""
    if options.data is None or not (what := difference(data.prior, model.prior)):
        return []
    return [
        f"{options.data} was drawn from another prior than the model's: {what}. The page's "
        "standard deviations are those of these pours, not of the model's"
    ]


def _of_observed(
    options: argparse.Namespace,
    model: Any,
    data: "Dataset",
    measured: list[dict[str, float]],
    unlike: list[str],
) -> int:
    from granulcal.calibrate import calibrate_measured

    words = [*observed.observed_words(options), *_own_words(options)]
    with shown():
        found = calibrate_measured(
            model,
            data,
            measured,
            report=options.out,
            seeds=options.seeds,
            threads=options.threads,
            notes=unlike,
            **_said(options, model, data, words),
        )
    return _tell(options, found, [], unlike)


def _of_images(options: argparse.Namespace, model: Any, data: "Dataset", unlike: list[str]) -> int:
    from granulcal.calibrate import calibrate
    from granulcal.measured.plausible import doubts, violations

    recordings = open_recordings(options)
    if impossible := violations(data.scene, model.prior, recordings, options.recording):
        options.told |= told_outside(options, impossible)
        print(outside(impossible))
        return UNHEALTHY
    doubtful = doubts(data.scene, model.prior, recordings, options.recording)
    warn(doubtful)
    doubtful = [*unlike, *doubtful]
    words = [*reading_words(options), *_own_words(options), "--draws", str(options.draws)]
    with shown():
        found = calibrate(
            model,
            data,
            recordings,
            report=options.out,
            seeds=options.seeds,
            draws=options.draws,
            threads=options.threads,
            notes=doubtful,
            **_said(options, model, data, words),
        )
    return _tell(options, found, recordings, doubtful)


def _own_words(options: argparse.Namespace) -> list[str]:
    words = ["-o", str(options.out), "--seeds", str(options.seeds)]
    return words if options.data is None else [*words, "--data", str(options.data)]


def _said(
    options: argparse.Namespace, model: Any, data: "Dataset", words: list[str]
) -> dict[str, Any]:
    """Title, summary and command of the page."""
    names = " ".join(str(path) for path in options.recording)
    command = ["granulcal", "report", str(options.model), *map(str, options.recording), *words]
    return {
        "title": f"Calibration from {names}",
        "summary": f"Parameters of the scene {data.scene.name!r}, inferred from {names} "
        f"with a model trained on {model.summary.pair_count} pours.",
        "command": shlex.join(command),
    }


def _tell(
    options: argparse.Namespace, found: "Calibrated", recordings: list[Any], doubtful: list[str]
) -> int:
    """Says where the page is and what is wrong with it; returns the exit code."""
    from granulcal.pours.left_out import LeftOut

    if not found.misfit.is_inside or found.misfit.odd_pour:
        print_misfit(found.misfit, options.recording)
    print(found.report)
    left_out = LeftOut.of_pours([*found.pours, *found.prior_pours])
    if left_out.total:
        print(f"note: of the pours on the page cannot be used: {left_out}", file=sys.stderr)
    options.told |= {
        "report": str(found.report),
        "inside_model": {
            "is_inside": found.misfit.is_inside,
            "p_value": found.misfit.p_value,
            "odd_pour": odd_pour_of(found.misfit),
        },
        "left_out": left_out.to_dict(),
        "warnings": doubtful,
    }
    return exit_code_of(recordings, not left_out.unhealthy and found.misfit.is_inside)
