"""The word `reproduce`: studies of docs/results, repeated."""

import argparse
import contextlib
import importlib
import json
import pkgutil
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from granulcal.commands.cluster import add_cluster, cluster_of
from granulcal.commands.counts import thread_count
from granulcal.commands.dry_run import add_dry_run, say_how_long_of
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.paths import READS, writes
from granulcal.pours.cluster import spread_over
from granulcal.progress import shown
from granulcal.words import did_you_mean

if TYPE_CHECKING:
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
        "--json",
        type=writes("json"),
        nargs="?",
        const=True,
        metavar="FILE",
        help="print JSON at the end; kinect_mounds: or write what each map gave to a file",
    )
    add_dry_run(parser)
    add_cluster(parser)
    paper = parser.add_argument_group("only with the study `paper`")
    paper.add_argument(
        "--quick", action="store_true", help="few grains and few pours; says so, proves nothing"
    )
    paper.add_argument(
        "--medium",
        action="store_true",
        help="400 grains a pour and the paper's counts of tests; for `shapes`, whose pours of 2000 "
        "grains take minutes each",
    )
    paper.add_argument(
        "--report",
        action="store_true",
        help="write one HTML page of all experiments; those that have run are not run again",
    )
    paper.add_argument("--threads", type=thread_count, help="pours at once (default: all cores)")
    parser.set_defaults(run=_with_json, goes_on=True)


def _with_json(options: argparse.Namespace) -> int:
    """With --json alone what is said on the way goes to stderr."""
    if options.json is not True:
        return _run(options)
    options.told = {}
    with contextlib.redirect_stdout(sys.stderr):
        code = _run(options)
    print(json.dumps({**options.told, "exit_code": code}, indent=1))
    return code


def _run(options: argparse.Namespace) -> int:
    from granulcal import experiments
    from granulcal.demo import measured_data

    # What studies share begins with an underscore.
    names = (module.name for module in pkgutil.iter_modules(experiments.__path__))
    studies = sorted(name for name in names if not name.startswith("_"))
    if options.study is None:
        print("\n".join(f"{name:<16} {_about(name)}" for name in studies))
        print("paper needs no data; the others read measured data, a folder that --data names")
        _tell(options, studies=studies)
        return DONE
    if options.study not in studies:
        near = did_you_mean(options.study, studies)
        raise ValueError(f"no study {options.study!r}; there are {', '.join(studies)}{near}")
    if options.study == "paper":
        return _reproduce_paper(options)
    for name in ("experiment", "quick", "medium", "report", "threads"):
        if getattr(options, name):
            raise ValueError(
                f"{name.replace('_', '-')} belongs to the study 'paper', not to {options.study!r}"
            )
    module = importlib.import_module(f"granulcal.experiments.{options.study}")
    data = options.data or measured_data()
    path = options.json if isinstance(options.json, Path) else None
    extra = {"maps_dir": options.maps, "json_path": path}
    given = {name: value for name, value in extra.items() if value is not None}
    if given and options.study != "kinect_mounds":
        raise ValueError(f"--maps and --json FILE are of kinect_mounds, not of {options.study}")
    if data is None and options.maps is None:
        raise FileNotFoundError(
            f"{options.study} reads measured data, of which there is none: give its folder with "
            "--data or in $GRANULCAL_DATA; `reproduce paper` needs none"
        )
    cluster = cluster_of(options)
    if options.dry_run:
        return _say_how_long(options, module, data)
    # A study of the loop says whether its verdicts stand.
    with shown(), spread_over(cluster):
        stands = module.reproduce(options.out, data, **given)
    _tell(options, study=options.study, out=str(options.out), stands=stands is not False)
    return UNHEALTHY if stands is False else DONE


def _about(study: str) -> str:
    """Returns what a study is of: the first line of its module."""
    module = importlib.import_module(f"granulcal.experiments.{study}")
    return (module.__doc__ or "").partition("\n")[0]


def _reproduce_paper(options: argparse.Namespace) -> int:
    from granulcal.experiments.paper import reproduce_paper
    from granulcal.experiments.paper.common.sizes import FULL, MEDIUM, QUICK

    if options.quick and options.medium:
        raise ValueError("--quick and --medium are two sizes: give one of them")
    size = QUICK if options.quick else MEDIUM if options.medium else FULL
    cluster = cluster_of(options)
    if options.dry_run:
        return _say_how_long_of_paper(options, size)
    with shown(), spread_over(cluster):
        reproduce_paper(
            options.out,
            options.experiment,
            size=size,
            report=options.report,
            threads=options.threads,
        )
    _tell(options, study="paper", out=str(options.out), experiment=options.experiment)
    return DONE


def _tell(options: argparse.Namespace, **told: object) -> None:
    if options.json is True:
        options.told |= told


def _say_how_long(options: argparse.Namespace, module: Any, data: Path | None) -> int:
    """Says what the pours of a study take, if it is one of many pours."""
    if not hasattr(module, "poured"):
        raise ValueError(
            f"--dry-run is of studies with a training set or an archive of pours; {options.study} "
            "pours a few scenes or none"
        )
    options.tells = options.json is True
    return say_how_long_of(options, module.poured(data), " at most")


def _say_how_long_of_paper(options: argparse.Namespace, size: "Size") -> int:
    """Says what the pours of the experiments take, from three pours of each kind of grain."""
    from granulcal.experiments.paper import missing_sets
    from granulcal.pours.pour_time import PourKind
    from granulcal.prior import Prior

    sets = missing_sets(options.out, options.experiment, size=size)
    kinds: dict[str, PourKind] = {}
    for one in sets:
        of = kinds.get(one.scene.to_toml(), PourKind(one.name, one.scene, Prior.default(), 0))
        kinds[one.scene.to_toml()] = replace(of, count=of.count + one.count)
    options.tells = options.json is True
    text = f" in {len(sets)} sets, training apart"
    return say_how_long_of(options, list(kinds.values()), text)
