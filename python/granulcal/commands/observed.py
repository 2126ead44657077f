"""`infer`, `report` and `calibrate` of what a scene observes: drums, run-outs, discharges, spills and the like."""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.commands.misfit import odd_pour_of, print_misfit
from granulcal.commands.parameters import parameters_of, print_parameters
from granulcal.files import write_beside
from granulcal.pours.scene import Scene

__all__ = [
    "add_observed",
    "is_of_observed",
    "measured_of",
    "not_measured",
    "observed_words",
    "read_measured",
    "refuse",
    "run",
]

_SAMPLES = 1000
_OURS = ("width", "fps", "series")
# What no depth recording is called; a picture (.png) is one of a drum where --width goes with it.
_TABLES = (".bmp", ".csv", ".json", ".txt")
_OF_RECORDINGS = ("camera", "topic", "camera_topic", "colour_topic", "first_frame", "border")


def add_observed(parser: argparse.ArgumentParser) -> None:
    """Adds what measurements of other kinds than depth images need besides their file."""
    parser.add_argument("--width", type=float, help="inner diameter of a drum's picture [m]")
    parser.add_argument(
        "--fps", type=float, help="frames a second of a run-out file (default: 240)"
    )
    parser.add_argument("--series", help="name of a discharge curve, where the file has several")


def observed_words(options: argparse.Namespace) -> list[str]:
    """Returns what `add_observed` was told, as words of a command line."""
    given = {name: getattr(options, name) for name in _OURS}
    return [f"--{name}={value}" for name, value in given.items() if value is not None]


def is_of_observed(document: dict[str, Any]) -> bool:
    """Returns whether a model's document is of statistics that its scene observes."""
    text = document["scene_toml"]
    if text is None:
        return False
    try:
        names = Scene.from_toml(text).observed_names
    except ValueError:
        # It may name meshes that are not here.
        return False
    return set(document["x_names"]) <= set(names)


def refuse(options: argparse.Namespace) -> None:
    """Refuses words for measurements that a model of depth images does not take.

    Raises:
        ValueError: one of them is there.
    """
    _refuse(options, _OURS, "goes with a model of what a scene observes; this one is of images")


def measured_of(options: argparse.Namespace, scene: Scene) -> dict[str, dict[str, float]] | None:
    """Returns the statistics of each measurement by its path; None where they are depth images.

    Raises:
        ValueError: a measurement is none of the scene's, or a word does not go with it.
    """
    tables = [path for path in options.recording if path.suffix.lower() in _TABLES]
    if not tables and options.width is None:
        _refuse(options, _OURS, "goes with measurements of what a scene observes, not with images")
        return None
    if not scene.observed_names:
        raise ValueError(
            f"{options.recording[0]} is no depth image, and the scene {scene.name} observes "
            "nothing else: say under [observe] what was measured (docs/scenes.md)"
        )
    _refuse(options, _OF_RECORDINGS, "is of depth images; these measurements are none")
    _require_different(options.recording)
    names = scene.observed_names
    return {str(path): _read(options, path, scene, names) for path in options.recording}


def not_measured(measured: dict[str, dict[str, float]]) -> list[str]:
    """Returns what is to be said of statistics that not every measurement has."""
    lacking: dict[str, list[str]] = {}
    for path, found in measured.items():
        for name in (name for name, value in found.items() if math.isnan(value)):
            lacking.setdefault(name, []).append(path)
    return [
        f"{name} is left out: {', '.join(paths)} {'has' if len(paths) == 1 else 'have'} no value "
        "of it"
        for name, paths in lacking.items()
    ]


def run(options: argparse.Namespace, folder: Path, document: dict[str, Any]) -> int:
    """Infers the parameters of measurements; returns the exit code.

    Raises:
        ValueError: a measurement lacks a statistic of the model, or is none of its scene.
    """
    from granulcal.assumed import assumed
    from granulcal.bayessim import BayesSim
    from granulcal.bayessim.check.identifiability import Identifiability
    from granulcal.calibrate import require_same_scene

    _require_samples(options)
    # Before PyTorch is loaded.
    observed = read_measured(options, document)
    model = BayesSim.load(folder)
    if options.scene is not None:
        require_same_scene(model, Scene.named(options.scene))
    misfit, posterior = model.misfit(observed), model.posterior(observed)
    known = Identifiability.of(posterior)
    found = {
        "recordings": [str(path) for path in options.recording],
        "parameters": parameters_of(posterior),
        "fixed": dict(model.prior.fixed),
        "inside_model": {
            "is_inside": misfit.is_inside,
            "impossible": [],
            "p_value": misfit.p_value,
            "joint_p_value": misfit.joint_p_value,
            "scatter_p_value": misfit.scatter_p_value,
            "statistics": {
                each.name: {"residual": each.residual, "p_value": each.p_value}
                for each in misfit.statistics
            },
            "odd_pour": odd_pour_of(misfit),
        },
        "identifiability": known.as_dict(),
        "calibrated": document.get("is_calibrated") is True,
        "warnings": [str(warning) for warning in posterior.warnings],
        "statistics": observed,
    }
    seed = options.seed or 0
    if options.json:
        drawn = (
            {} if not options.samples else {"samples": _samples(posterior, options.samples, seed)}
        )
        print(json.dumps({**found, **drawn}, indent=1))
    else:
        print_misfit(misfit, options.recording)
        print_parameters(found["parameters"])
        print(known)
        if line := assumed(document["scene_toml"], model.prior):
            print(line, flush=True)
    for warning in found["warnings"]:
        print(f"note: {warning}", file=sys.stderr)
    if not found["calibrated"]:
        told = "note: the model has not passed a check of its own: see `granulcal check`"
        print(told, file=sys.stderr)
    if options.out is not None:
        kept = {**found, "samples": _samples(posterior, _SAMPLES, seed)}
        write_beside(options.out, json.dumps(kept, indent=1) + "\n")
    if options.plot is not None:
        title = "" if misfit.is_inside else "OUTSIDE THE MODEL: its best compromise"
        posterior.pair_plot(options.plot, title=title)
    return DONE if misfit.is_inside else UNHEALTHY


def read_measured(options: argparse.Namespace, document: dict[str, Any]) -> list[dict[str, float]]:
    """Returns what each measurement says of the statistics of a model.

    Raises:
        ValueError: a measurement lacks a statistic of the model, or is none of its scene.
    """
    _refuse(options, _OF_RECORDINGS, "is of depth images; this model is of what its scene observes")
    _require_different(options.recording)
    scene = Scene.from_toml(document["scene_toml"])
    names = document["x_names"]
    return [_measured(options, path, scene, names) for path in options.recording]


def _measured(
    options: argparse.Namespace, path: Path, scene: Scene, names: Sequence[str]
) -> dict[str, float]:
    """The statistics of the model by name, as one measurement has them."""
    found = _read(options, path, scene, names)
    if lacking := [name for name in names if not found[name] == found[name]]:
        raise ValueError(
            f"{path} has no value of {', '.join(lacking)}, which the model was trained on: it "
            "must be measured, or the scene must not observe it"
        )
    return found


def _read(
    options: argparse.Namespace, path: Path, scene: Scene, names: Sequence[str]
) -> dict[str, float]:
    from granulcal.measured.recording import Recording

    found = Recording.observed(
        path, scene, width=options.width, fps=options.fps, series=options.series
    )
    return {name: found[name] for name in names}


def _require_different(paths: Sequence[Path]) -> None:
    """Refuses a file that is given twice.

    The same numbers may be two pours: grains that were counted, a slope read off to a degree.
    """
    there = [path.resolve() for path in paths]
    for path, place in zip(paths, there, strict=True):
        if there.count(place) > 1:
            raise ValueError(f"each recording must be given once, got {path} twice")


def _require_samples(options: argparse.Namespace) -> None:
    """Refuses draws that are asked for and printed nowhere, and fewer than none."""
    if options.samples is None:
        return
    if options.samples < 0:
        raise ValueError(f"--samples must be at least 0, got {options.samples}")
    if not options.json:
        raise ValueError("--samples goes with --json, which prints them; --out keeps 1000")


def _samples(posterior: Any, count: int, seed: int) -> list[list[float]]:
    return posterior.sample(count, seed=seed).tolist()


def _refuse(options: argparse.Namespace, names: Sequence[str], why: str) -> None:
    for name in names:
        if getattr(options, name, None) is not None:
            raise ValueError(f"--{name.replace('_', '-')} {why}")
