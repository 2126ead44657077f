"""The word `calibrate`: a material from recordings with few pours, made for them alone."""

import argparse
import json
import sys
import warnings
from functools import partial
from typing import TYPE_CHECKING, Any

from granulcal.commands.cluster import add_cluster, cluster_of
from granulcal.commands.counts import pour_count, seed_number, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.commands.exit_code import UNHEALTHY
from granulcal.commands.misfit import odd_pour_of, print_misfit
from granulcal.commands.observed import add_observed, measured_of, not_measured
from granulcal.commands.parameters import parameters_of, print_parameters
from granulcal.commands.reading import (
    add_reading,
    exit_code_of,
    open_recordings,
    outside,
    told_outside,
)
from granulcal.errors import DoubtfulRecordingWarning
from granulcal.files import write_beside
from granulcal.paths import READS, writes
from granulcal.warned import warn

if TYPE_CHECKING:
    from granulcal.bayessim.training.sequential import SequentialFit
    from granulcal.measured.recording import Recording
    from granulcal.prior import Prior

__all__ = ["add"]


_SAMPLES = 1000


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "infer the parameters from recordings with few pours, made in rounds for them alone"
    parser = commands.add_parser("calibrate", help=text, description=text)
    parser.add_argument("scene", type=READS, help="scene as TOML, or the word funnel or drop")
    parser.add_argument("prior", type=READS, help="prior as TOML, or the word default")
    add_reading(parser)
    add_observed(parser)
    parser.add_argument(
        "--budget", type=pour_count, default=100, help="pours in all, at least 60 (default: 100)"
    )
    parser.add_argument(
        "-o", "--out", type=writes("calibration"), required=True, help="folder; holds the pours"
    )
    parser.add_argument("--seed", type=seed_number, default=0, help="seed of the run (default: 0)")
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    parser.add_argument("--engine", help="another simulator in place of ours: docs/engines.md")
    add_cluster(parser, store=False)
    add_dry_run(parser)
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.set_defaults(run=_run, goes_on=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.assumed import assumed
    from granulcal.bayessim.training.sequential import round_sizes
    from granulcal.engines import engine_named
    from granulcal.loop.recorded import doubt_of_start
    from granulcal.measured.plausible import doubts, violations
    from granulcal.pours.scene import Scene
    from granulcal.prior import Prior
    from granulcal.progress import shown
    from granulcal.within_budget import calibrate_observed, calibrate_within

    scene = Scene.named(options.scene)
    prior = Prior.named(options.prior)
    engine = None if options.engine is None else engine_named(options.engine)
    round_sizes(options.budget)
    if options.dry_run:
        return say_how_long(options, scene, prior, options.budget, engine=engine)
    measured = measured_of(options, scene)
    recordings: list[Recording] = []
    doubtful: list[str] = []
    if measured is None:
        recordings = open_recordings(options)
        if impossible := violations(scene, prior, recordings, options.recording):
            document = told_outside(options, impossible)
            print(json.dumps(document, indent=1) if options.json else outside(impossible))
            return UNHEALTHY
        doubtful = doubt_of_start("the scene", scene)
        doubtful += doubts(scene, prior, recordings, options.recording)
    else:
        doubtful = not_measured(measured)
    warn(doubtful)
    # Told when the recordings were opened.
    unlike = [f"{r.path}: {r.unlike}" for r in recordings if r.unlike is not None]
    first: list[int] = []

    def poured(kept: int) -> None:
        # What was kept before the first pour of this run is not counted in the time that is left.
        first.append(kept - 1)
        line(options.budget, first[0], kept - first[0], 0)

    with shown() as line, warnings.catch_warnings():
        # They have been told.
        warnings.simplefilter("ignore", DoubtfulRecordingWarning)
        run = (
            partial(calibrate_within, scene, prior, recordings)
            if measured is None
            else partial(calibrate_observed, scene, prior, measured)
        )
        found = run(
            budget=options.budget,
            out=options.out,
            seed=options.seed,
            threads=options.threads,
            progress=lambda each: print(each, file=sys.stderr, flush=True),
            poured=poured,
            engine=engine,
            ray=cluster_of(options),
        )
    document = _document(options, prior, found, [*unlike, *doubtful])
    # What has been found is printed, whatever becomes of the file.
    lost: OSError | None = None
    try:
        # The file may leave its folder: it says what its numbers are of.
        kept = {**document, "scene_toml": scene.to_toml()}
        write_beside(options.out / "posterior.json", json.dumps(kept, indent=1) + "\n")
    except OSError as error:
        lost = error
    code = _say(options, found, document, recordings, assumed(scene.to_toml(), prior))
    if lost is not None:
        raise lost
    return code


def _document(
    options: argparse.Namespace, prior: "Prior", found: "SequentialFit", told: list[str]
) -> dict[str, Any]:
    """Returns what was found, for JSON; `told` are the doubts about the recordings."""
    posterior = found.posterior
    return {
        "recordings": [str(path) for path in options.recording],
        "parameters": parameters_of(posterior),
        "fixed": dict(prior.fixed),
        "engine": options.engine,
        "inside_model": {
            "is_inside": found.misfit.is_inside,
            "p_value": found.misfit.p_value,
            "odd_pour": odd_pour_of(found.misfit),
            "impossible": [],
        },
        "pours": len(found.x),
        "usable": found.rounds[-1].usable,
        "left_out": found.left_out.to_dict(),
        "warnings": [*told, *map(str, posterior.warnings)],
        "samples": posterior.sample(_SAMPLES).tolist(),
    }


def _say(
    options: argparse.Namespace,
    found: "SequentialFit",
    document: dict[str, Any],
    recordings: "list[Recording]",
    taken_for_known: str,
) -> int:
    """Prints what was found, and under what; returns the exit code."""
    posterior = found.posterior
    if options.json:
        del document["samples"]
        print(json.dumps(document, indent=1))
        return exit_code_of(recordings, found.misfit.is_inside)
    print_misfit(found.misfit, options.recording)
    print_parameters(document["parameters"])
    print(taken_for_known)
    print(f"{found.rounds[-1]}; {found.choice}")
    print(f"pours that cannot be used: {found.left_out}")
    for warning in posterior.warnings:
        print(f"note: {warning}", file=sys.stderr)
    return exit_code_of(recordings, found.misfit.is_inside)
