"""Pours that are made elsewhere: `--engine` of `simulate` and `generate`, `generate --ray`."""

import argparse
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from granulcal import paths
from granulcal.commands.cluster import add_cluster, cluster_of
from granulcal.commands.dry_run import add_dry_run, say_how_long
from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.commands.program import Parser
from granulcal.commands.setting import setting
from granulcal.files import beside
from granulcal.paths import READS, writes
from granulcal.pours.status import NO_GRAINS, UNUSABLE

if TYPE_CHECKING:
    from granulcal.pours.scene import Scene
    from granulcal.pours.simulate import Pour

__all__ = ["is_asked", "parser", "run"]

_ENGINE, _RAY, _STORE = "--engine", "--ray", "--ray-store"
# Options of `generate` that mean nothing here, and why: of a cluster, of another engine.
_REFUSED = {
    "shard": (
        "the cluster divides the rows itself",
        "one process makes all rows of another engine",
    ),
    "flush_every": (
        "a part comes whole from the worker that makes it, and is written at once",
        "rows of another engine are written every 30 s",
    ),
}
# Options of `simulate` that mean nothing for another engine, and why.
_OURS = {
    "threads": "it takes the cores that it wants",
    "depth": "only its grains at rest come back; gc.Camera.record makes an image of them",
    "depth_unit": "only its grains at rest come back",
    "mcap": "only its grains at rest come back",
    "fps": "only its grains at rest come back",
    "checkpoint": "it is run to its end",
    "checkpoint_every": "it is run to its end",
    "resume": "it is run to its end",
}


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
    simulate.add_argument("--diagnostics", action="store_true")
    for name in _OURS:
        simulate.add_argument(f"--{name.replace('_', '-')}", help=argparse.SUPPRESS)
    simulate.set_defaults(run=_simulate)
    generate = commands.add_parser("generate")
    _add_common(generate)
    generate.add_argument(_ENGINE)
    add_cluster(generate)
    generate.add_argument("prior", type=READS)
    generate.add_argument("-n", "--rows", type=int, default=1000)
    generate.add_argument("-o", "--out", type=writes("data_set"), required=True)
    generate.add_argument("--threads", type=int)
    generate.add_argument("--chunk", type=int)
    add_dry_run(generate)
    for name in _REFUSED:
        generate.add_argument(f"--{name.replace('_', '-')}", help=argparse.SUPPRESS)
    generate.add_argument("--no-resume", action="store_true")
    generate.set_defaults(run=_generate)
    return whole


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("scene", type=READS)
    parser.add_argument("--set", action="append", default=[], type=setting, metavar="PATH=NUMBER")
    parser.add_argument("--preset")
    parser.add_argument("--sensor", type=READS)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("-q", "--quiet", action="store_true")
    parser.add_argument("-v", "--verbose", action="count", default=0)


def _scene(options: argparse.Namespace) -> "Scene":
    """Returns the scene that the words describe: preset, sensor and numbers in place of its own."""
    from granulcal.pours.scene import Scene

    scene = Scene.named(options.scene)
    if options.preset is not None:
        scene = scene.with_(preset=options.preset)
    if options.sensor is not None:
        scene = scene.with_sensor(options.sensor)
    return scene.with_(dict(options.set))


def _simulate(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named
    from granulcal.pours.simulate import simulate

    for name, why in _OURS.items():
        if getattr(options, name) is not None:
            raise ValueError(f"--{name.replace('_', '-')} is not for {_ENGINE}: {why}")
    scene = _scene(options)
    pour = simulate(scene, seed=options.seed, engine=engine_named(options.engine))
    # Before anything is told of them: a pour may have taken hours.
    if options.positions is not None:
        with beside(options.positions) as temporary:
            np.save(temporary, pour.positions)
    status, statistics, diagnostics = _seen(pour, options.diagnostics)
    document = {
        "scene": scene.name,
        "seed": options.seed,
        "engine": options.engine,
        "status": status,
        "grains_in_funnel": pour.grains_in_funnel,
        "statistics": statistics,
    }
    if options.diagnostics:
        document["diagnostics"] = diagnostics
    if options.json:
        print(json.dumps(document, indent=1))
    else:
        print(f"scene              {scene.name} (seed {options.seed})")
        print(f"engine             {options.engine}")
        print(f"status             {status}")
        for name, value in ((statistics or {}) | (diagnostics or {})).items():
            print(f"{name:<18} {value:<12.6f}")
    return UNHEALTHY if status in ("unhealthy", NO_GRAINS) else DONE


def _seen(
    pour: "Pour", with_diagnostics: bool
) -> tuple[str, dict[str, float] | None, dict[str, float] | None]:
    """Returns status, statistics and diagnostics of a pour, None where they cannot be told."""
    try:
        statistics = pour.statistics().to_dict()
        diagnostics = pour.diagnostic_statistics().to_dict() if with_diagnostics else None
    except ValueError as error:
        print(f"warning: no statistics: {error}", file=sys.stderr)
        says_enough = pour.status in UNUSABLE or pour.scene.observed_names
        return (pour.status if says_enough else NO_GRAINS), None, None
    return pour.status, statistics, diagnostics


def _generate(options: argparse.Namespace) -> int:
    from granulcal.engines import engine_named
    from granulcal.pours.cluster import refuse_engine
    from granulcal.pours.dataset import generate
    from granulcal.prior import Prior
    from granulcal.progress import ProgressLine

    _refuse(options)
    cluster = cluster_of(options)
    engine = None if options.engine is None else engine_named(options.engine)
    scene, prior = _scene(options), Prior.named(options.prior)
    if cluster is not None:
        refuse_engine(engine)
    if options.dry_run:
        return say_how_long(options, scene, prior, options.rows, engine=engine)
    line = None if options.quiet else ProgressLine()
    total, resumed, made = options.rows, 0, 0

    def poured(*counts: int) -> None:
        nonlocal total, resumed, made
        total, resumed, made = counts[:3]
        if line is not None:
            line(*counts)

    try:
        data = generate(
            scene,
            prior,
            options.rows,
            seed=options.seed,
            out=options.out,
            threads=options.threads,
            resume=not options.no_resume,
            progress=poured,
            engine=engine,
            ray=cluster,
            chunk=options.chunk,
        )
    finally:
        if line is not None:
            line.close()
    if options.json:
        counts = data.status_counts()
        told = {"folder": str(options.out), "rows": len(data), "total": total, "made": made}
        told |= {"resumed": resumed, "stopped": False, "status": counts}
        # The keys of `granulcal-cli generate --json`.
        told |= {key: counts.get(key, 0) for key in ("unhealthy", "no_grains_in_view", "jammed")}
        told["at_horizon"] = counts.get("horizon", 0)
        print(json.dumps(told))
    else:
        print(f"{options.out}: {data}")
    left_out = data.left_out
    if left_out.total:
        print(f"note: pours that cannot be used: {left_out}", file=sys.stderr)
    # As our own simulator's: a jammed pour is a good one that tells nothing.
    return UNHEALTHY if left_out.unhealthy or left_out.no_grains_in_view else DONE


def _refuse(options: argparse.Namespace) -> None:
    """Refuses options of `generate` that mean nothing here.

    Raises:
        ValueError: one is given; says why it is refused.
    """
    for name, (of_cluster, of_engine) in _REFUSED.items():
        if getattr(options, name) is not None:
            where, why = (_ENGINE, of_engine) if options.ray is None else (_RAY, of_cluster)
            raise ValueError(f"--{name.replace('_', '-')} is not for {where}: {why}")
    if options.ray is not None and options.threads is not None and not options.dry_run:
        raise ValueError(
            f"--threads is not for {_RAY}: as many pours run at once as the cluster has cores"
        )
