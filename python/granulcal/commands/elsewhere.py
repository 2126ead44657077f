"""Pours that are made elsewhere: `--engine` of `simulate` and `generate`, `generate --ray`."""

import argparse
import json
import sys
from collections.abc import Sequence

import numpy as np

from granulcal import paths
from granulcal.commands.cluster import add_cluster, cluster_of
from granulcal.commands.init import assignment
from granulcal.commands.program import Parser
from granulcal.files import beside
from granulcal.paths import READS, writes

__all__ = ["is_asked", "parser", "run"]

_ENGINE, _RAY, _STORE = "--engine", "--ray", "--ray-store"
_UNHEALTHY = 3


def is_asked(words: Sequence[str]) -> bool:
    """Returns whether the words name another engine or a cluster."""
    return any(word.split("=")[0] in (_ENGINE, _RAY, _STORE) for word in words)


def run(words: Sequence[str]) -> int:
    """Runs `simulate` or `generate`; returns the exit code."""
    try:
        known = parser()
        options = known.parse_args(words)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 2
    paths.check(known, options)
    return options.run(options)


def parser() -> argparse.ArgumentParser:
    """Returns the parser of both commands."""
    whole = Parser(prog="granulcal")
    commands = whole.add_subparsers(required=True, dest="command")
    simulate = commands.add_parser("simulate")
    _add_common(simulate)
    simulate.add_argument(_ENGINE, required=True)
    simulate.add_argument("--positions", type=writes("array"))
    simulate.set_defaults(run=_simulate)
    generate = commands.add_parser("generate")
    _add_common(generate)
    generate.add_argument(_ENGINE)
    add_cluster(generate)
    generate.add_argument("prior", type=READS)
    generate.add_argument("-n", "--rows", type=int, default=1000)
    generate.add_argument("-o", "--out", type=writes("data_set"), required=True)
    generate.add_argument("--threads", type=int)
    generate.add_argument("--no-resume", action="store_true")
    generate.set_defaults(run=_generate)
    return whole


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=READS)
    parser.add_argument("--set", action="append", default=[], type=assignment)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("-q", "--quiet", action="store_true")


def _simulate(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named
    from granulcal.pours.scene import Scene
    from granulcal.pours.simulate import simulate

    scene = Scene.named(options.scene).with_(dict(options.set))
    pour = simulate(scene, seed=options.seed, engine=engine_named(options.engine))
    statistics = pour.statistics().to_dict()
    if options.positions is not None:
        with beside(options.positions) as temporary:
            np.save(temporary, pour.positions)
    document = {
        "scene": scene.name,
        "seed": options.seed,
        "engine": options.engine,
        "status": pour.status,
        "grains_in_funnel": pour.grains_in_funnel,
        "statistics": statistics,
    }
    if options.json:
        print(json.dumps(document, indent=1))
    else:
        print(f"scene              {scene.name} (seed {options.seed})")
        print(f"engine             {options.engine}")
        print(f"status             {pour.status}")
        for name, value in statistics.items():
            print(f"{name:<18} {value:<12.6f}")
    return 0 if pour.status != "unhealthy" else _UNHEALTHY


def _generate(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named
    from granulcal.pours.dataset import generate
    from granulcal.pours.scene import Scene
    from granulcal.prior import Prior

    scene = Scene.named(options.scene).with_(dict(options.set))
    data = generate(
        scene,
        Prior.named(options.prior),
        options.rows,
        seed=options.seed,
        out=options.out,
        threads=options.threads,
        resume=not options.no_resume,
        progress=not options.quiet,
        engine=None if options.engine is None else engine_named(options.engine),
        ray=cluster_of(options),
    )
    counts = data.status_counts()
    if options.json:
        print(json.dumps({"folder": str(options.out), "rows": len(data), "status": counts}))
    else:
        print(f"{options.out}: {data}")
    left_out = data.left_out
    if left_out.total:
        print(f"note: pours that cannot be used: {left_out}", file=sys.stderr)
    return 0 if not left_out.total else _UNHEALTHY
