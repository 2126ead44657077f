"""The drum's free surface and slope at speeds that were not measured here."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from granulcal.experiments.loop_drum.task import SPEEDS as PICTURED
from granulcal.experiments.loop_drum.task import at_speed, task
from granulcal.experiments.predictions.between_speeds import (
    MODELS as WITHOUT_PHYSICS,
)
from granulcal.experiments.predictions.between_speeds import between_speeds, read_pictures
from granulcal.experiments.predictions.drum_base import SETTINGS, DrumBase
from granulcal.experiments.predictions.drum_fit import (
    KEPT,
    POINTS,
    ROUNDS,
    UNKNOWN,
    DrumFit,
    true_size,
)
from granulcal.loop.pours.forward import Forward
from granulcal.loop.report.models import Models
from granulcal.loop.report.prediction import Prediction
from granulcal.pours.pour_time import PourKind

__all__ = ["SPEEDS", "drum_rows", "drum_rows_without_loop", "poured_of_drum"]

SPEEDS = {10: (2.0, 2.6), 20: (1.3, 1.7), 30: (1.1, 1.4), 60: (0.9, 1.2)}
"""Rounds a minute, and when the mean begins and ends [s]: once the surface stands."""

# What is poured; the rows without physics have a file of their own.
_SIMULATED = ("named", "base", "corrected")
_POURS = 8
_PLACE = re.compile(r"surface_z\[(?P<x>[^\]]+)\]")


def drum_rows(
    models: Models, pours: Path, *, say: Callable[[str], None]
) -> tuple[list[tuple[object, ...]], list[tuple[object, ...]]]:
    """Returns rows (model, rpm, x, z, low, high) in mm and (model, rpm, slope, low, high)."""
    forward = Forward(pours, 1)
    profiles: list[tuple[object, ...]] = []
    slopes: list[tuple[object, ...]] = []
    for rpm, (begin, end) in SPEEDS.items():
        for model in _SIMULATED:
            try:
                found = models.predict(model, at_speed(rpm, begin, end), forward, pours=_POURS)
            except ValueError as error:
                say(f"drum, {model} at {rpm} rpm: no prediction: {error}")
                continue
            more, slope = _rows(model, rpm, found)
            profiles += more
            slopes.append(slope)
    return profiles, slopes


def drum_rows_without_loop(
    data: Path, pours: Path | None, *, say: Callable[[str], None]
) -> tuple[list[tuple[object, ...]], list[tuple[object, ...]]]:
    """Returns the same rows of `line` and `nearest`, told from the pictures alone.

    With a folder of `pours`, those of `base` and `corrected` of the drum fitted to them come first.
    """
    speeds, names, values = read_pictures(data)
    matches = [_PLACE.fullmatch(name) for name in names]
    places = [None if found is None else float(found["x"]) for found in matches]
    base = None if pours is None else DrumBase(data, pours)
    settings: tuple[dict[str, float], ...] = ()
    if base is not None:
        for model, (height, slope, share) in base.held(SPEEDS, speeds, places).items():
            say(
                f"drum, {model}: simulated drums told from {speeds[0]:.0f} and {speeds[1]:.0f} rpm "
                f"with an rms of {1e3 * height:.2f} mm and {slope:.1f} degrees; {share:.0%} in the "
                "90 % intervals"
            )
        is_slope = np.array([x is None for x in places])
        settings = DrumFit(base, speeds, values, is_slope, say=say).settings
        base.fill("drum: pours", [(one, *at) for one in settings for at in SPEEDS.items()])
    profiles: list[tuple[object, ...]] = []
    slopes: list[tuple[object, ...]] = []
    for rpm, window in SPEEDS.items():
        plain = {m: between_speeds(m, speeds, values, rpm, places) for m in WITHOUT_PHYSICS}
        if base is None or not settings:
            told = plain
        else:
            told = base.tell(settings, rpm, window, speeds, values, places) | plain
        for model, found in told.items():
            more, slope = _rows(model, rpm, Prediction(model, names, *found, 0.9))
            profiles += more
            slopes.append(slope)
    return profiles, slopes


def poured_of_drum(data: Path) -> list[PourKind]:
    """Returns what `drum_rows_without_loop` pours, at most but for pours that are not usable."""
    pictured, told = len(PICTURED), len(SPEEDS)
    scene = task(data).scene
    larger = POINTS * pictured + len(SETTINGS) * (pictured + told)
    true = ROUNDS * pictured + KEPT * told
    sizes = {"1.7 mm": (scene, larger), "1.2 mm": (scene.with_(true_size(scene)), true)}
    return [
        PourKind(f"the drum, {size}", scene.with_(at_speed(15, *PICTURED[15])), UNKNOWN, count)
        for size, (scene, count) in sizes.items()
    ]


def _rows(
    model: str, rpm: int, found: Prediction
) -> tuple[list[tuple[object, ...]], tuple[object, ...]]:
    """The profile from left to right, and the slope."""
    profile, slope = [], ()
    for name, middle, low, high in zip(
        found.names, found.middle.tolist(), found.low.tolist(), found.high.tolist(), strict=True
    ):
        place = _PLACE.fullmatch(name)
        if place is not None:
            x = 1e3 * float(place["x"])
            profile.append((model, rpm, x, 1e3 * middle, 1e3 * low, 1e3 * high))
        elif name == "surface_slope":
            slope = (model, rpm, middle, low, high)
    return sorted(profile, key=lambda row: float(str(row[2]))), slope
