"""The loop on mounds: a ball of sand dropped on a hard bed, groups of maps, half of them sealed.

The base model is the ball of `kinect_mounds.toml` without cohesion, on a bed of its own material.
Maps of neighbouring number are repeats under one unknown height, for the number looks like the
order of heights; every other one is sealed. Groups and halves were chosen by number.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.experiments._groups import close_groups, verdict_lines
from granulcal.experiments.kinect_mounds import (
    FOLDER,
    READING,
    SHAPE,
    picture,
    shape_of_map,
    shape_of_pour,
    study_prior,
    study_scene,
)
from granulcal.files import write_beside
from granulcal.loop.close import Closed
from granulcal.loop.effects.definitions import Definition
from granulcal.loop.effects.law import law_numbers
from granulcal.loop.effects.library import LibraryEffect, by_name
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.measured.recording import Recording
from granulcal.pours.pour_time import PourKind
from granulcal.pours.simulate import Pour, simulate
from granulcal.prior import Prior

__all__ = ["DEFINITIONS", "EFFECTS", "GROUPS", "reproduce", "task"]

_BUDGET = 1930
# Free numbers of the contact law: two dimensions more are what the archive can bear.
_LAW = ("touching_exponent", "torsional_friction")
# Pours at the fit that the maps are held against, and their first seed: apart from the loop's own.
_POURS, _SEED = 10, 900_000
# How the table shows what sees clods.
_TITLES, _UNITS = ("patches", "roughness [mm]", "shoulder"), np.array([1.0, 1e3, 1.0])

GROUPS = {
    "early": ((1, 4, 7, 10), (2, 5, 8, 11)),
    "late": ((13, 16, 19, 22), (14, 17, 20, 23)),
}
"""Numbers of the maps: fitted as repeats, and sealed."""

# Up to what holds clods together in `kinect_mounds`, and a bed that stops what rolls and falls.
_FULL = {"cohesion.dry": 10.0, "ground.rolling": 0.1, "ground.restitution": 0.0}

DEFINITIONS = (
    Definition("above 1 mm", {"camera.height_threshold": 1e-3}),
    Definition("above 1.5 mm", {"camera.height_threshold": 1.5e-3}, {"height_threshold": 1.5e-3}),
    Definition("above 2 mm", {"camera.height_threshold": 2e-3}, {"height_threshold": 2e-3}),
    Definition("a border of 9 pixels", {"camera.height_threshold": 1e-3}, {"border_px": 9}),
)
"""Where a mound begins: the first is the verdict's. Late maps have a noise of up to 0.6 mm."""

EFFECTS: tuple[LibraryEffect, ...] = tuple(
    replace(effect, full=_FULL.get(effect.name, effect.full))
    for effect in (
        *by_name([*_FULL, "bonds", "drag", "count", "tilt.x", "camera.scale"]),
        # Registered later: at the end, for an archive of the others to go on.
        *by_name(["polydispersity"]),
    )
)
"""What sand may have that a ball of dry grains on their own material has not."""


def task(data: Path, group: str) -> Task:
    """Returns what is asked of a group of maps; the height of the fall is unknown and its own."""
    scene = study_scene()
    # What `kinect_mounds` has of cohesion and the bed are candidates here.
    known = (one for one in study_prior().parameters if not one.path.startswith("effects."))
    prior = Prior([*known, *law_numbers(_LAW, scene)])
    conditions = tuple(
        Condition(f"{group} mounds, {use}", {}, use, _maps(data, numbers), reading=READING)
        for use, numbers in zip((FIT, SEALED), GROUPS[group], strict=True)
    )
    return Task(scene, prior, conditions, EFFECTS, definitions=DEFINITIONS)


def _maps(data: Path, numbers: Sequence[int]) -> tuple[Path, ...]:
    return tuple(data / FOLDER / f"compacted_{number}.npz" for number in numbers)


def poured(data: Path) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    asked = task(data, next(iter(GROUPS)))
    return [PourKind("the archive", asked.at_first(), asked.prior, _BUDGET)]


def reproduce(out: Path, data: Path) -> bool:
    """Runs the loop on both groups of mounds; results.md and pages in `out`/loop_mounds.

    Returns whether every verdict stands.
    """
    folder = out / "loop_mounds"
    closed = close_groups(
        folder,
        {group: task(data, group) for group in GROUPS},
        budget=_BUDGET,
        command=f"granulcal reproduce loop_mounds --out {out}",
        title="Mounds on a hard bed",
    )
    lines, names, clouds = [], [], []
    for group, one in closed.items():
        scene = one.scene(one.task.of(FIT)[0], one.trace.best)
        pours = [simulate(scene, seed=_SEED + i) for i in range(_POURS)]
        lines += [*verdict_lines(group, one), *_clods(one, pours)]
        paths = [path for use in (FIT, SEALED) for c in one.task.of(use) for path in c.recordings]
        for path, pour in zip(paths, pours, strict=False):
            names.append(path.stem)
            clouds.append((Recording.open(path).formation(**READING).points, pour.points()))
    picture(folder / "mounds.png", names, clouds)
    write_beside(folder / "results.md", "\n".join(lines) + "\n")
    print(folder / "results.md")
    return all(one.standing.stands for one in closed.values())


def _clods(closed: Closed, pours: Sequence[Pour]) -> list[str]:
    """Patches, roughness and shoulder of every map beside the range of the pours, as Markdown.

    A number within that range is marked.
    """
    made = _UNITS * np.array([shape_of_pour(pour) for pour in pours])
    low, high = made.min(axis=0), made.max(axis=0)
    ends = " | ".join(f"{_shown(a)} to {_shown(b)}" for a, b in zip(low, high, strict=True))
    lines = [
        "| | " + " | ".join(_TITLES) + " |",
        "|---" * (1 + len(SHAPE)) + "|",
        f"| pours at the fit | {ends} |",
    ]
    inside, count = np.zeros(len(SHAPE), int), 0
    for use in (FIT, SEALED):
        for path in (path for c in closed.task.of(use) for path in c.recordings):
            seen = _UNITS * shape_of_map(Recording.open(path), closed.task.scene)
            held = (low <= seen) & (seen <= high)
            inside, count = inside + held, count + 1
            label = f"{path.stem}{' (sealed)' if use == SEALED else ''}"
            lines.append(f"| {label} | {_cells(seen, held)} |")
    counts = " | ".join(f"{n} of {count}" for n in inside)
    return [*lines, f"| within the range | {counts} |", ""]


def _cells(values: NDArray[np.float64], marked: NDArray[np.bool_]) -> str:
    each = zip(values, marked, strict=True)
    return " | ".join(f"**{_shown(v)}**" if held else _shown(v) for v, held in each)


def _shown(value: float) -> str:
    return f"{value:.3g}"
