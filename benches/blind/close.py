"""Closes the loop on every blind set that has no verdict yet; reports stay beside the sets.

    python benches/blind/close.py out/sets --archive out/archive

All sets share one archive and its surrogate. Their loop.toml has the free numbers of the contact
law free in every fit (`law = true`): engines that agree on friction and restitution differ there.
"""

import argparse
from pathlib import Path

from arguments import add_part

from granulcal.loop.close import close_loop, fit_surrogate, planned
from granulcal.loop.pours.archive import Archive
from granulcal.loop.report.folder import write_report
from granulcal.loop.task import Task

BUDGET, SEED = 3629, 1


def main() -> None:
    """Runs the sets in the order of their names."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", type=Path)
    parser.add_argument("--archive", type=Path, required=True)
    add_part(parser, "; start 0 first, alone, until it has filled the archive")
    parser.add_argument("--report", default="report", help="folder in a set's (default: report)")
    options = parser.parse_args()
    part, parts = options.part
    surrogate = None
    for file in sorted(options.sets.glob("set-*/loop.toml"))[part::parts]:
        out = file.parent / options.report
        if (out / "report.html").exists():
            continue
        task = Task.load(file)
        if surrogate is None:
            store = Archive(options.archive, planned(task, BUDGET, SEED))
            store.fill()
            surrogate = fit_surrogate(store, seed=SEED)
        closed = close_loop(
            task,
            out,
            archive=options.archive,
            budget=BUDGET,
            seed=SEED,
            pairs=0,
            surrogate=surrogate,
            say=lambda line: None,
        )
        write_report(
            closed,
            out,
            command=f"granulcal close-loop {file}",
            title=file.parent.name,
            say=lambda line: None,
        )
        verdict = closed.trace.verdict
        print(f"{file.parent.name}: {verdict.kind} {', '.join(verdict.named)} (p {verdict.p:.3g})")


if __name__ == "__main__":
    main()
