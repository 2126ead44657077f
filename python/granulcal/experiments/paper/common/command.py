"""`granulcal reproduce paper`: which experiments, how large, where to."""

import importlib
import pkgutil
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from granulcal import _native
from granulcal.cores import cores
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.outcome import Outcome
from granulcal.experiments.paper.common.page import write_page, write_tables
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import FULL, Size
from granulcal.experiments.paper.common.workshop import Workshop

__all__ = ["experiments", "find", "missing_sets", "reproduce_paper", "run_one"]


def experiments() -> list[Experiment]:
    """Returns every experiment, by its number: each module of the package that has one."""
    from granulcal.experiments import paper

    found = []
    for module in pkgutil.iter_modules(paper.__path__):
        if not module.ispkg:
            loaded = importlib.import_module(f"{paper.__name__}.{module.name}")
            found.append(loaded.EXPERIMENT)
    return sorted(found, key=lambda each: each.number)


def find(word: str) -> Experiment:
    """Returns the experiment of a name or number.

    Raises:
        ValueError: there is none; the message lists them.
    """
    known = experiments()
    for each in known:
        if word.replace("_", "-") in (each.name, str(each.number)):
            return each
    listed = ", ".join(f"{e.number} {e.name}" for e in known)
    raise ValueError(f"the paper has no experiment {word!r} here; there are {listed}")


def missing_sets(out: Path, experiment: str | None = None, *, size: Size = FULL) -> list[PouredSet]:
    """Returns the pours that `reproduce_paper` would need, each set once.

    What an experiment that has run rests on is not among them; of a set that was begun all are.
    """
    folder = _folder(out, size)
    wanted = experiments() if experiment is None else [find(experiment)]
    done, missing = {}, {}
    for each in experiments():
        if Outcome.is_complete(folder / each.name):
            done |= {one.name: one for one in each.sets(size)}
    for each in wanted:
        missing |= {one.name: one for one in each.sets(size) if one.name not in done}
    return list(missing.values())


def _folder(out: Path, size: Size) -> Path:
    return out / ("paper" if size.is_full else f"paper-{size.name}")


def reproduce_paper(
    out: Path,
    experiment: str | None = None,
    *,
    size: Size = FULL,
    report: bool = False,
    threads: int | None = None,
    quiet: bool = False,
) -> Path | None:
    """Runs one experiment of the paper, or all, and writes what they found below `out`.

    A run that is stopped goes on where it was: pours and models are kept.

    Args:
        out: folder; the runs of each size have a folder of their own in it.
        experiment: name or number; None for all.
        size: how large.
        report: write one HTML page of all experiments that have run at this size; alone, without an
            experiment, nothing is run that has run already.
        threads: pours at once; the default is one for each core.
        quiet: print nothing.

    Returns:
        The page, if one was asked for.
    """
    folder = _folder(out, size)
    wanted = experiments() if experiment is None else [find(experiment)]
    if size.note and not quiet:
        print(size.note)
    for each in wanted:
        if report and experiment is None and Outcome.is_complete(folder / each.name):
            continue
        run_one(each, folder, size=size, threads=threads, quiet=quiet)
    if not report:
        return None
    page = write_page(folder, experiments(), size)
    tables = write_tables(folder, experiments())
    if not quiet:
        print(f"page: {page}\ntables: {tables}")
    return page


def run_one(
    experiment: Experiment,
    folder: Path,
    *,
    size: Size,
    threads: int | None = None,
    quiet: bool = False,
) -> Outcome:
    """Runs an experiment, writes result.json into its folder and prints its rows."""
    if not quiet:
        print(f"{experiment.number} {experiment.name}: {experiment.asks}", flush=True)
    shop = Workshop(folder, experiment.name, size, threads or cores(), quiet)
    began = time.monotonic()
    quick = "" if size.is_full else f" --{size.name}"

    def keep(outcome: Outcome) -> dict[str, Any]:
        made = {
            "command": f"granulcal reproduce paper {experiment.name}{quick} --out {folder.parent}",
            "size": size.name,
            "seeds": shop.seeds,
            "pours": shop.pours,
            "pours_cpu_s": shop.cpu_s,
            "this_run_s": time.monotonic() - began,
            "version": _native.__version__,
            "at": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        }
        outcome.save(shop.own, made)
        return made

    shop.so_far = keep
    outcome = experiment.run(shop)
    made = keep(outcome)
    if not quiet:
        _print(outcome, made)
    return outcome


def _print(outcome: Outcome, made: dict[str, Any]) -> None:
    print(f"  {outcome.answer}")
    for row in outcome.rows:
        paper = f"; paper {row.paper}" if row.paper else ""
        interval = f" [{row.interval}]" if row.interval else ""
        verdict = f": {row.verdict}" if row.verdict else ""
        print(f"  {row.quantity}: {row.ours}{interval}, n = {row.count}{paper}{verdict}")
    print(f"  {made['pours']} pours, {made['this_run_s']:.0f} s in this run\n", flush=True)
