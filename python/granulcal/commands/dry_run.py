"""The flag `--dry-run`: how long a command would take, from three pours or its first steps."""

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

__all__ = ["add_dry_run", "cost", "say_how_long", "say_seconds"]

_TRIED = 3
# Draws of their own: a run that follows is not begun by them.
_SEED = 97


def add_dry_run(
    parser: "argparse.ArgumentParser | argparse._ArgumentGroup", *, by: str = "three pours"
) -> None:
    """Adds the flag; `by` is what the time is found from."""
    parser.add_argument(
        "--dry-run",
        action="store_true",
        help=f"say how long it would take, from {by}, and make nothing",
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
        options: may have `threads` and, for JSON with the words of `generate --dry-run`, `json`.
        scene: what would be poured.
        prior: what would be drawn.
        pours: those that are missing, at most.
        engine: another simulator in place of ours, or of the one in use.
    """
    threads = getattr(options, "threads", None) or os.cpu_count() or 1
    each = cost(scene, prior, engine=engine)
    text = (
        f"at most {pours} pours, {each:.2f} s of a core each (mean of {_TRIED} pours), "
        f"{threads} at once"
    )
    told = {"missing": pours, "threads": threads, "pour_cpu_s": each}
    return say_seconds(options, pours * each / threads, text, **told)


def say_seconds(options: argparse.Namespace, seconds: float, text: str, **told: object) -> int:
    """Says how long a command would take; returns 0.

    Args:
        options: with `json` the answer is a JSON object, at the end where the command `tells`.
        seconds: the time [s].
        text: what it consists of.
        **told: the same for JSON.
    """
    told["seconds"] = seconds
    tells = getattr(options, "tells", False)
    if tells:
        options.told |= told
    if getattr(options, "json", False) and not tells:
        print(json.dumps(told, indent=1))
    else:
        print(f"about {duration(seconds)}: {text}")
    return 0
