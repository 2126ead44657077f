"""The word `close-loop` of the command line; the loop itself needs torch and is imported late."""

import argparse
import contextlib
import shlex
import sys
import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granulcal.commands.cluster import add_cluster, cluster_of
from granulcal.commands.counts import pour_count, seed_number, thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.paths import KEPT, READS, writes
from granulcal.progress import shown
from granulcal.warned import warn

if TYPE_CHECKING:
    from granulcal.loop.task import Task

__all__ = ["add"]

_TEXT = "find what the model lacks, add it, and report the error before and after"
_DESCRIPTION = """\
Find what the model lacks, add it, and report the error before and after.

TASK is a TOML file: a scene, a prior of the material, and recordings under at
least one condition (pour heights, fluids, drum speeds), each condition to `fit`
or `sealed`:

    scene = "scene.toml"
    prior = "prior.toml"
    [[conditions]]
    name = "4 cm"
    at = { "funnel.height" = 0.04 }
    use = "fit"
    recordings = ["04cm/pour-0.png", "04cm/pour-1.png"]

What may be wrong with the measurement is declared, and is never a finding:
before the conditions

    nuisances = { "tilt.x" = 0.005, "height" = { sd = 0.001, shared = false } }

and in conditions that share what each has of its own session = "monday"
(docs/theory/loop.md, "Own errors").

Written to the folder -o: preregistration.json (before any data is seen),
verdict.json, models.json (what `predict` reads), report.html, and the tables
conditions, candidates and residuals.parquet. The archive of pours may serve
tasks of one scene, prior and seed whose lists of effects begin alike; all of it
is resumed after an interruption. Verdicts: NONE, RESIDUAL (not sure enough for
a name), EFFECT, SET (not distinguished), EFFECTS (two), UNEXPLAINED; and, with
exit code 3, UNCONFIRMED (a check of the loop's own took the word away; `reason`
of verdict.json says which) and OVERTURNED (by another definition of what is
examined, [[definitions]] of the task).
"""
# The exit code of what is done and does not stand.
_FALLEN = 3


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    parser = commands.add_parser(
        "close-loop",
        help=_TEXT,
        description=_DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("task", type=READS, help="TOML file, or the folder with its loop.toml")
    parser.add_argument(
        "-o", "--out", type=writes("loop"), required=True, help="folder of the report"
    )
    parser.add_argument("--archive", type=KEPT, help="folder of the pours (default: OUT/archive)")
    parser.add_argument(
        "--tolerances", type=READS, help="JSON of directions in which the statistics may be off"
    )
    parser.add_argument(
        "--budget",
        type=pour_count,
        default=4000,
        help="pours, but for those of a name's rivals and of a fit that is looked at again (default: "
        "4000)",
    )
    parser.add_argument(
        "--pairs",
        type=int,
        default=20,
        help="simulated pairs that calibrate the interval of a named effect's strength, of the "
        "budget; at least 19, or 0 for the interval of the model's own pours (default: 20)",
    )
    parser.add_argument(
        "--rounds",
        type=int,
        default=0,
        help="rounds of further pours where the fits are, once a residual is found, after each of "
        "which everything is asked again; 96 pours of the budget each (default: none)",
    )
    parser.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    parser.add_argument(
        "--seed", type=seed_number, default=0, help="seed of everything (default: 0)"
    )
    add_dry_run(parser)
    parser.add_argument("--engine", help="another simulator in place of ours: docs/engines.md")
    add_cluster(parser)
    parser.add_argument("--json", action="store_true", help="print the verdict as JSON at the end")
    parser.set_defaults(run=_run, goes_on=True)


def _run(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named, pouring_with
    from granulcal.pours.cluster import spread_over

    engine = None if options.engine is None else engine_named(options.engine)
    cluster = cluster_of(options)
    if options.dry_run:
        from granulcal.loop.call import check_call
        from granulcal.loop.close import planned
        from granulcal.loop.pours.archive import require_same
        from granulcal.loop.task import Task
        from granulcal.loop.test.thresholds import Thresholds

        task = Task.load(_file(options))
        names = ("budget", "threads", "seed", "pairs", "rounds")
        check_call(task, **{name: getattr(options, name) for name in names})
        warn(task.require_readable())
        asked = (options.budget, options.seed, options.pairs, options.rounds, Thresholds())
        planned(task, *asked)
        with pouring_with(engine):
            if options.archive is not None:
                require_same(options.archive, planned(_told(task), *asked))
            poured = [task.scene.with_(condition.at) for condition in task.conditions]
            return say_how_long(options, poured, task.prior, options.budget)
    aside = contextlib.redirect_stdout(sys.stderr) if options.json else contextlib.nullcontext()
    with aside, pouring_with(engine), spread_over(cluster):
        code = _close(options)
    if not options.json:
        return code
    print((options.out / "verdict.json").read_text(encoding="utf-8"), end="")
    return code


def _file(options: argparse.Namespace) -> Path:
    return options.task / "loop.toml" if options.task.is_dir() else options.task


def _close(options: argparse.Namespace) -> int:
    from granulcal.loop.close import close_loop
    from granulcal.loop.effects.tolerance import Tolerances
    from granulcal.loop.task import Task
    from granulcal.measured.recording import UnlikeFramesWarning

    path = _file(options)
    task = Task.load(path)
    if options.tolerances is not None:
        task = replace(task, tolerances=Tolerances.load(options.tolerances))
    task = _told(task)
    with shown(), warnings.catch_warnings():
        # Told among the doubts of the recordings.
        warnings.simplefilter("ignore", UnlikeFramesWarning)
        closed = close_loop(
            task,
            options.out,
            archive=options.archive,
            budget=options.budget,
            threads=options.threads,
            seed=options.seed,
            pairs=options.pairs,
            rounds=options.rounds,
            command=_command(options, path),
        )
    return 0 if closed.standing.stands else _FALLEN


def _command(options: argparse.Namespace, task: Path) -> str:
    """The command line that makes the report again."""
    words: list[str | Path] = ["granulcal", "close-loop", task, "-o", options.out]
    for name in ("archive", "tolerances", "pairs", "rounds", "engine", "budget", "seed"):
        # A zero is not the default.
        if (value := getattr(options, name)) is not None:
            words += [f"--{name}", str(value)]
    return shlex.join(map(str, words))


def _told(task: "Task") -> "Task":
    """Returns a task without the effects that the engine in use cannot be told, which it names."""
    from granulcal.engines import ExportedEngine, engine_in_use

    engine = engine_in_use()
    if not isinstance(engine, ExportedEngine):
        # A command or function of one's own gets the whole scene.
        return task
    kept = []
    for effect in task.library:
        scene = task.scene.with_(effect.at(task.scene).numbers(1.0))
        if left_out := engine.refuses(scene):
            print(f"{effect.name} is not looked for: engine {engine.name} has no {left_out}")
        else:
            kept.append(effect)
    return replace(task, library=tuple(kept))
