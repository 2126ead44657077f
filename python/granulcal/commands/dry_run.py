"""The flag `--dry-run`: how long a command would take, from three pours or its first steps.

The answer comes within a minute: pours that take longer are stopped and extrapolated.
"""

import argparse
import json
from typing import TYPE_CHECKING

from granulcal.cores import cores
from granulcal.progress import duration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from granulcal.engines import Engine
    from granulcal.pours.pour_time import PourKind, PourTime
    from granulcal.pours.scene import Scene
    from granulcal.prior import Prior

__all__ = ["add_dry_run", "cost", "say_how_long", "say_how_long_of", "say_seconds"]

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


def cost(
    scene: "Scene | Sequence[Scene]",
    prior: "Prior",
    *,
    engine: "Engine | None" = None,
    share: int = 1,
) -> "PourTime":
    """Returns what a pour costs, from three draws of a prior or fewer, if they take long.

    Args:
        scene: what is poured; of several some that lie evenly between the first and the last.
        prior: what is drawn.
        engine: another simulator in place of ours, or of the one in use.
        share: one part in so many of the time that a dry run has.
    """
    from granulcal.pours.forward import scene_at
    from granulcal.pours.pour_time import PATIENCE_S, pour_time
    from granulcal.pours.scene import Scene

    all_ = [scene] if isinstance(scene, Scene) else list(scene)
    places = [round(i * (len(all_) - 1) / (_TRIED - 1)) for i in range(_TRIED)]
    drawn = zip(places, prior.sample(_TRIED, seed=_SEED), strict=True)
    scenes = [scene_at(all_[place], prior, theta) for place, theta in drawn]
    return pour_time(scenes, seed=_SEED, engine=engine, patience=PATIENCE_S / share)


def say_how_long(
    options: argparse.Namespace,
    scene: "Scene | Sequence[Scene]",
    prior: "Prior",
    pours: int,
    *,
    engine: "Engine | None" = None,
) -> int:
    """Pours draws of a prior and says how long `pours` of them would take; returns 0.

    Args:
        options: may have `threads`, `ray` and, for JSON with the words of `generate --dry-run`,
            `json`.
        scene: what would be poured, or several.
        prior: what would be drawn.
        pours: those that are missing, at most.
        engine: another simulator in place of ours, or of the one in use.
    """
    threads = _at_once(options)
    each = cost(scene, prior, engine=engine)
    text = f"at most {pours} pours, {each}, {threads} at once"
    told = {"missing": pours, "threads": threads, "pour_cpu_s": each.seconds}
    told["extrapolated"] = each.cut is not None
    return say_seconds(options, pours * each.seconds / threads, text, **told)


def say_how_long_of(
    options: argparse.Namespace, kinds: "Sequence[PourKind]", text: str, **told: object
) -> int:
    """Pours draws of every kind and says how long all of them would take; returns 0.

    Args:
        options: may have `threads`, `ray` and, for JSON, `json`.
        kinds: what would be poured.
        text: follows the number of pours.
        **told: more for JSON.
    """
    threads = _at_once(options)
    # Kinds of one scene are tried once.
    first = {kind.scene.to_toml(): kind for kind in reversed(kinds)}
    costs = {toml: cost(kind.scene, kind.prior, share=len(first)) for toml, kind in first.items()}
    each = [costs[kind.scene.to_toml()] for kind in kinds]
    seconds = sum(k.count * one.seconds for k, one in zip(kinds, each, strict=True)) / threads
    missing = sum(kind.count for kind in kinds)
    told |= {"missing": missing, "threads": threads}
    told["extrapolated"] = any(one.cut is not None for one in each)
    say_seconds(options, seconds, f"{missing} pours{text}, {threads} at once", **told)
    if not getattr(options, "json", False):
        for kind, one in zip(kinds, each, strict=True):
            print(f"  {kind.count} pours of {kind.name}: {one}")
    return 0


def _at_once(options: argparse.Namespace) -> int:
    """Returns how many pours are made at once: as many as asked, or as there are cores for them."""
    if getattr(options, "threads", None):
        return options.threads
    if getattr(options, "ray", None) is None:
        return cores()
    from granulcal.pours.cluster import Cluster, cores_of

    return cores_of(Cluster(options.ray))


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
