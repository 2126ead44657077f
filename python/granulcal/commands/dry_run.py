"""The flag `--dry-run` of commands that pour: how long it would take, from three pours."""

import argparse
import json
import math
import os
import time
from typing import TYPE_CHECKING

from granulcal.progress import duration

if TYPE_CHECKING:
    from granulcal.engines import Engine
    from granulcal.pours.scene import Scene
    from granulcal.prior import Prior

__all__ = ["add_dry_run", "cost", "say_how_long"]

_TRIED = 3
# Draws of their own: a run that follows is not begun by them.
_SEED = 97


def add_dry_run(parser: argparse.ArgumentParser) -> None:
    """Adds the flag."""
    parser.add_argument(
        "--dry-run",
        action="store_true",
        help="say how long it would take, from three pours, and make nothing",
    )


def cost(scene: "Scene", prior: "Prior", *, engine: "Engine | None" = None) -> float:
    """Returns what a pour costs, the mean of three draws of a prior [s of a core]."""
    from granulcal.engines import engine_in_use
    from granulcal.pours.forward import scene_at
    from granulcal.pours.simulate import simulate

    foreign = engine or engine_in_use()
    took = []
    for i, theta in enumerate(prior.sample(_TRIED, seed=_SEED)):
        begun = time.monotonic()
        pour = simulate(scene_at(scene, prior, theta), seed=_SEED + i, engine=foreign)
        # Nobody knows the processor's time of another engine.
        known = foreign is None and math.isfinite(pour.cpu_seconds)
        took.append(pour.cpu_seconds if known else time.monotonic() - begun)
    return sum(took) / _TRIED


def say_how_long(
    options: argparse.Namespace,
    scene: "Scene",
    prior: "Prior",
    pours: int,
    *,
    engine: "Engine | None" = None,
) -> int:
    """Pours three draws of a prior and says how long `pours` of them would take; returns 0.

    Args:
        options: has `threads` and, for JSON with the words of `generate --dry-run`, `json`.
        scene: what would be poured.
        prior: what would be drawn.
        pours: those that are missing, at most.
        engine: another simulator in place of ours, or of the one in use.
    """
    each, threads = cost(scene, prior, engine=engine), options.threads or os.cpu_count() or 1
    seconds = pours * each / threads
    if getattr(options, "json", False):
        told = {"missing": pours, "threads": threads, "pour_cpu_s": each, "seconds": seconds}
        print(json.dumps(told, indent=1))
    else:
        print(
            f"about {duration(seconds)}: at most {pours} pours, {each:.2f} s of a core each "
            f"(mean of {_TRIED} pours), {threads} at once"
        )
    return 0
