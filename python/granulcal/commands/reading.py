"""Arguments and opening of recordings and models, which several words share."""

import argparse
import warnings
from collections.abc import Sequence
from typing import Any

from granulcal.commands.exit_code import DONE, UNHEALTHY
from granulcal.paths import READS, RECORDING
from granulcal.warned import warn

__all__ = [
    "TRAINING",
    "add_reading",
    "add_recordings",
    "exit_code_of",
    "open_model",
    "open_recordings",
    "outside",
    "reading_words",
    "told_outside",
]

# The data set that a model was trained on, in the model's folder.
TRAINING = "training.parquet"


def add_recordings(parser: argparse.ArgumentParser) -> None:
    """Adds a model, recordings for it and the scene that it has to be of."""
    parser.add_argument("model", type=READS, help="folder of `train`, or a scene of `model`")
    add_reading(parser)
    parser.add_argument(
        "--scene",
        type=READS,
        help="refuse a model of another scene than this TOML, or the word funnel or drop",
    )


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Adds recordings and how they are read."""
    parser.add_argument(
        "recording",
        type=RECORDING,
        nargs="+",
        help=".bag, .mcap, .npz height map, 16-bit depth PNG, .npy or folder of PNGs; "
        "several: pours of one material under one condition, each another pour (PNGs of one are a "
        "folder)",
    )
    parser.add_argument(
        "--camera",
        type=READS,
        help="TOML of the camera (default: of images camera.toml or NAME.toml beside them)",
    )
    parser.add_argument("--topic", help="topic of the depth images, where several fit")
    parser.add_argument("--camera-topic", help="topic of the lens, where several fit")
    parser.add_argument("--colour-topic", help="topic of the colour images, where several fit")
    parser.add_argument(
        "--frames",
        type=_frames,
        default=10,
        help="frames to average, or all (default: the last 10)",
    )
    parser.add_argument("--first-frame", type=int, help="index of the first of them, from 0")


def reading_words(options: argparse.Namespace) -> list[str]:
    """Returns what `add_reading` was told but the recordings, as words of a command line."""
    words = []
    for name in ("camera", "topic", "camera_topic", "colour_topic", "first_frame"):
        if getattr(options, name) is not None:
            words.append(f"--{name.replace('_', '-')}={getattr(options, name)}")
    return [*words, f"--frames={options.frames or 'all'}"]


def open_model(options: argparse.Namespace, *, of_images: bool = True) -> Any:
    """Returns the model that `add_recordings` names, if it is of the scene that is asked.

    Args:
        options: the words.
        of_images: whether it must be of the statistics of an image.
    """
    from granulcal.starter.models import model_named

    # Before PyTorch is loaded: a name that leads nowhere is told at once.
    folder = model_named(options.model)
    from granulcal.bayessim import BayesSim
    from granulcal.calibrate import require_own_statistics, require_same_scene
    from granulcal.pours.scene import Scene

    model = BayesSim.load(folder)
    if of_images:
        require_own_statistics(model)
    if options.scene is not None:
        require_same_scene(model, Scene.named(options.scene))
    return model


def open_recordings(options: argparse.Namespace) -> list[Any]:
    """Returns the recordings of `add_reading`; what is lost of them is told on stderr."""
    from granulcal.measured.recording import (
        DamagedRecordingWarning,
        Recording,
        UnlikeFramesWarning,
    )

    opened: list[Any] = []
    for path in options.recording:
        with warnings.catch_warnings():
            # Told below in the manner of a command line.
            warnings.simplefilter("ignore", DamagedRecordingWarning)
            warnings.simplefilter("ignore", UnlikeFramesWarning)
            recording = Recording.open(
                path,
                camera=options.camera,
                topic=options.topic,
                camera_topic=options.camera_topic,
                colour_topic=options.colour_topic,
                frames=options.frames,
                first_frame=options.first_frame,
            )
        warn(recording.damage)
        own = (recording.unlike, recording.lost)
        warn(f"{path}: {told}" for told in own if told is not None)
        opened.append(recording)
    return opened


def outside(reasons: Sequence[str]) -> str:
    """Returns what is said of recordings that cannot be of the scene."""
    first = "OUTSIDE THE MODEL: this cannot be a formation of the scene, whatever its material."
    return "\n".join([first, *(f"  {reason}" for reason in reasons), "No posterior is given."])


def told_outside(options: argparse.Namespace, reasons: Sequence[str]) -> dict[str, Any]:
    """Returns the same for JSON, in the fields of `infer`."""
    return {
        "recordings": [str(path) for path in options.recording],
        "parameters": None,
        "inside_model": {"is_inside": False, "p_value": None, "impossible": list(reasons)},
    }


def exit_code_of(recordings: Sequence[Any], is_healthy: bool = True) -> int:
    """Returns the exit code: are all frames and pours as they should be?"""
    is_whole = all(recording.lost is None for recording in recordings)
    return DONE if is_healthy and is_whole else UNHEALTHY


def _frames(text: str) -> int | None:
    if text == "all":
        return None
    try:
        frames = int(text)
    except ValueError:
        told = f"must be a whole number of at least 1, or all, got {text!r}"
        raise argparse.ArgumentTypeError(told) from None
    if frames < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, or all, got {frames}")
    return frames
