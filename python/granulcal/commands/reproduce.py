"""The word `reproduce`: studies of docs/results, repeated."""

import argparse
import importlib
import os
import pkgutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granulcal.commands.cluster import add_cluster, cluster_of
from granulcal.commands.dry_run import add_dry_run, cost
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.paths import READS, writes
from granulcal.pours.cluster import spread_over
from granulcal.progress import duration, shown

if TYPE_CHECKING:
    from granulcal.experiments.paper.common.outcome import PouredSet
    from granulcal.experiments.paper.common.sizes import Size

__all__ = ["add"]


def add(commands: Any) -> None:
    """Adds the word to the command line."""
    text = "repeat a study of docs/results; without a name, list them"
    parser = commands.add_parser("reproduce", help=text, description=text)
    parser.add_argument("study", nargs="?", help="name of the study")
    parser.add_argument(
        "experiment", nargs="?", help="of the study `paper`: its name or number (default: all)"
    )
    parser.add_argument(
        "--out", type=writes("folder"), default=Path("out"), help="folder (default: out)"
    )
    parser.add_argument("--data", type=READS, help="measured data (default: $GRANULCAL_DATA)")
    parser.add_argument(
        "--maps", type=READS, help="kinect_mounds: folder of other maps compacted_*.npz"
    )
    parser.add_argument(
        "--json", type=writes("json"), help="kinect_mounds: file for what each map gave"
    )
    add_cluster(parser)
    paper = parser.add_argument_group("only with the study `paper`")
    paper.add_argument(
        "--quick", action="store_true", help="few grains and few pours; says so, proves nothing"
    )
    paper.add_argument(
        "--report",
        action="store_true",
        help="write one HTML page of all experiments; those that have run are not run again",
    )
    paper.add_argument("--threads", type=int, help="pours at once (default: all cores)")
    add_dry_run(paper)
    parser.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from granulcal import experiments
    from granulcal.demo import measured_data

    studies = sorted(module.name for module in pkgutil.iter_modules(experiments.__path__))
    if options.study is None:
        print("\n".join(studies))
        return DONE
    if options.study not in studies:
        raise ValueError(f"no study {options.study!r}; there are {', '.join(studies)}")
    if options.study == "paper":
        return _reproduce_paper(options)
    for name in ("experiment", "quick", "report", "threads", "dry_run"):
        if getattr(options, name):
            raise ValueError(
                f"{name.replace('_', '-')} belongs to the study 'paper', not to {options.study!r}"
            )
    module = importlib.import_module(f"granulcal.experiments.{options.study}")
    data = options.data or measured_data()
    extra = {"maps_dir": options.maps, "json_path": options.json}
    given = {name: value for name, value in extra.items() if value is not None}
    if given and options.study != "kinect_mounds":
        raise ValueError(f"--maps and --json are of kinect_mounds, not of {options.study}")
    if data is None and options.maps is None:
        raise FileNotFoundError("no measured data: give --data or set $GRANULCAL_DATA")
    # A study of the loop says whether its verdicts stand.
    with shown(), spread_over(cluster_of(options)):
        stands = module.reproduce(options.out, data, **given)
    return UNHEALTHY if stands is False else DONE


def _reproduce_paper(options: argparse.Namespace) -> int:
    from granulcal.experiments.paper import reproduce_paper
    from granulcal.experiments.paper.common.sizes import FULL, QUICK

    if options.dry_run:
        return _say_how_long(options, QUICK if options.quick else FULL)
    with shown(), spread_over(cluster_of(options)):
        reproduce_paper(
            options.out,
            options.experiment,
            size=QUICK if options.quick else FULL,
            report=options.report,
            threads=options.threads,
        )
    return DONE


def _say_how_long(options: argparse.Namespace, size: "Size") -> int:
    """Says what the pours of the experiments take, from three pours of each kind of grain."""
    from granulcal.experiments.paper import missing_sets
    from granulcal.prior import Prior

    sets, threads = missing_sets(options.out, options.experiment, size=size), options.threads
    threads = threads or os.cpu_count() or 1
    counts: dict[str, int] = {}
    first: dict[str, PouredSet] = {}
    for each in sets:
        text = each.scene.to_toml()
        first.setdefault(text, each)
        counts[text] = counts.get(text, 0) + each.count
    costs = {text: cost(each.scene, Prior.default()) for text, each in first.items()}
    seconds = sum(count * costs[text] for text, count in counts.items()) / threads
    print(
        f"about {duration(seconds)}, training apart: {sum(counts.values())} pours in {len(sets)} "
        f"sets, {threads} at once"
    )
    for text, count in counts.items():
        print(f"  {count} pours at {costs[text]:.2f} s of a core, as of {first[text].name}")
    return DONE
