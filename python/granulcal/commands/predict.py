"""The word `predict` of the command line: what a closed loop says of a condition not measured."""

import argparse
import json
import sys
from typing import TYPE_CHECKING, Any

from granulcal.commands.counts import thread_count
from granulcal.commands.dry_run import add_dry_run, say_seconds
from granulcal.commands.numbers import at_least, probability
from granulcal.cores import cores
from granulcal.paths import READS
from granulcal.progress import shown
from granulcal.warned import warn

if TYPE_CHECKING:
    from collections.abc import Mapping

    from granulcal.loop.report.prediction import Prediction
    from granulcal.pours.scene import Scene

__all__ = ["add"]

# The exit code of what is done and does not stand.
_FALLEN = 3
_MODELS = ("base", "named", "corrected", "line", "nearest")

_TEXT = "what a closed loop, or a posterior, says of a condition that was not measured"
_DESCRIPTION = """\
What the models of a closed loop say of a condition that was not measured, with
intervals.

LOOP is the folder -o of close-loop. The condition states the numbers in which
the measured ones differ:

  granulcal predict loop --at funnel.height=0.07               of the verdict
  granulcal predict loop --at funnel.height=0.07 --corrected   base and residual
  granulcal predict loop --at funnel.height=0.07 --model line  through the means

The correction, the line and the nearest condition know no physics and hold
between and near the measured conditions alone; farther away they are refused,
and so is a number that all conditions share and that is asked for otherwise.
The other models pour there and warn, also of a number asked for in place of a
fitted one. `named` has the most probable candidate where the verdict names
none: what a model has is printed, and stands in the JSON. A loop closed with
--engine pours with the same.
Intervals are those of one pour. Exit code 3: the loop's verdict does not stand.

From a posterior of `infer -o` or `calibrate`, with the scene that it is of:

  granulcal predict posterior.json scene.toml --at funnel.height=0.07
  granulcal predict run scene.toml --at funnel.height=0.07   of calibrate -o run

pours at draws of it; exit code 3: its recordings were outside the model.
"""


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser(
        "predict",
        help=_TEXT,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "loop",
        type=READS,
        help="folder -o of close-loop, or JSON of `infer -o`, or that or the folder of `calibrate`",
    )
    parser.add_argument(
        "scene", type=READS, nargs="?", help="of a posterior: TOML, or the word funnel or drop"
    )
    parser.add_argument(
        "--at",
        action="append",
        required=True,
        metavar="PATH=NUMBER",
        help="a number of the condition; once for each",
    )
    kinds = parser.add_mutually_exclusive_group()
    kinds.add_argument(
        "--corrected",
        action="store_const",
        const="corrected",
        dest="model",
        help="the base model and its own interpolated residual; no physics, named nothing",
    )
    kinds.add_argument(
        "--model",
        choices=_MODELS,
        metavar="MODEL",
        help=f"which predicts: {', '.join(_MODELS)} (default: named, the verdict's)",
    )
    parser.add_argument(
        "--level", type=probability, default=0.9, help="of the interval (default: 0.9)"
    )
    parser.add_argument(
        "--pours", type=at_least(2), default=20, help="simulated pours, at least 2 (default: 20)"
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    parser.add_argument(
        "--engine", help="the simulator with which the loop was closed, if not ours"
    )
    add_dry_run(parser)
    parser.add_argument("--json", action="store_true", help="everything as JSON on stdout")
    parser.set_defaults(run=_run, goes_on=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named, pouring_with

    if options.scene is not None:
        return _of_posterior(options)
    from granulcal.loop.pours.forward import Forward
    from granulcal.loop.report.asked import condition_of
    from granulcal.loop.report.models import Models

    models, threads = Models.load(options.loop), options.threads or cores()
    at, engine, model = condition_of(options.at), None, options.model or "named"
    doubts = models.doubts(model, at)
    warn(doubts)
    if options.engine is not None:
        engine = engine_named(options.engine)
    if options.dry_run:
        with pouring_with(engine):
            models.require_engine(model)
            return _say_how_long(options, models.scenes(model, at), threads)
    with shown(), pouring_with(engine):
        found = models.predict(
            model,
            at,
            Forward(options.loop / "pours", threads),
            level=options.level,
            pours=options.pours,
        )
    warn(found.doubts)
    if options.json:
        told = found.to_dict()
        told |= {"at": at, "verdict": models.verdict, "units": models.units}
        told |= {"has": models.described(model, at), "warnings": [*doubts, *found.doubts]}
        print(json.dumps(told, indent=1, allow_nan=False))
        return _outcome(models.verdict["kind"])
    word = " ".join([models.verdict["kind"], *models.verdict["named"]])
    print(f"{found.model} at {', '.join(options.at)}; the loop's verdict: {word}")
    print(f"{found.model} is {models.said(model, at)}")
    _print_table(found, models.units)
    return _outcome(models.verdict["kind"])


def _print_table(found: "Prediction", units: "Mapping[str, str]") -> None:
    share = f"{100 * found.level:g} % from"
    print(f"{'statistic':<24}{'middle':>12}{share:>14}{'to':>12}  unit")
    for name, middle, low, high in zip(
        found.names, found.middle, found.low, found.high, strict=True
    ):
        print(f"{name:<24}{middle:>12.5g}{low:>14.5g}{high:>12.5g}  {units[name]}")


def _of_posterior(options: argparse.Namespace) -> int:
    from granulcal.design.posterior_file import PosteriorDraws
    from granulcal.design.predict_posterior import poured_scenes, predict_posterior
    from granulcal.engines import engine_named, pouring_with
    from granulcal.loop.report.asked import condition_of
    from granulcal.pours.scene import Scene

    if options.model is not None:
        raise ValueError(
            f"the model {options.model} is of a closed loop: with a scene {options.loop} is a "
            "posterior's"
        )
    at, scene = condition_of(options.at), Scene.named(options.scene)
    posterior = PosteriorDraws.load(options.loop)
    engine = None if options.engine is None else engine_named(options.engine)
    threads = options.threads or cores()
    scenes = poured_scenes(posterior, scene, at, options.pours)
    with shown(), pouring_with(engine):
        if options.dry_run:
            return _say_how_long(options, scenes[:1], threads)
        found = predict_posterior(
            posterior, scene, at, level=options.level, pours=options.pours, threads=threads
        )
    doubts = list(found.doubts)
    if options.engine != posterior.engine:
        learnt, poured = (name or "granulcal" for name in (posterior.engine, options.engine))
        doubts.append(
            f"the material was inferred by pours of {learnt}, these are of {poured}: what one engine "
            "calls a friction is none of another's (--engine)"
        )
    warn(doubts)
    if options.json:
        told = {"at": at, "units": scene.units_of(found.names), "is_inside": posterior.is_inside}
        told["warnings"] = doubts
        print(json.dumps(found.to_dict() | told, indent=1, allow_nan=False))
    else:
        print(
            f"{found.pours} pours of {scene.name} at {', '.join(options.at)}, at draws of a posterior"
        )
        _print_table(found, scene.units_of(found.names))
    return 0 if posterior.is_inside else _FALLEN


def _say_how_long(options: argparse.Namespace, scenes: "list[Scene]", threads: int) -> int:
    from granulcal.pours.pour_time import pour_time

    if not scenes:
        return say_seconds(options, 0.0, "no pours", missing=0)
    each, pours = pour_time(scenes), options.pours * len(scenes)
    text = f"at most {pours} pours, {each}, {threads} at once"
    told = {"missing": pours, "extrapolated": each.cut is not None}
    return say_seconds(options, pours * each.seconds / threads, text, **told)


def _outcome(kind: str) -> int:
    """Exit code 3 for a loop whose verdict does not stand: its surrogate or its fit is wrong."""
    from granulcal.loop.check.standing import FALLEN

    if kind in FALLEN:
        print(f"warning: the loop is {kind}: its fit does not stand", file=sys.stderr)
        return _FALLEN
    return 0
