"""A trained model as a folder: model.json and weights.safetensors, never pickle."""

import json
import os
import shutil
import tempfile
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.numpy import load as read_tensors
from safetensors.numpy import save as tensor_bytes

from granulcal.bayessim.config import Config
from granulcal.bayessim.network import HeadLayout, Network
from granulcal.bayessim.signal import SignalAxes
from granulcal.bayessim.standardise import Standardiser
from granulcal.bayessim.summary import Calibration, TrainingSummary
from granulcal.errors import ModelFormatError, PriorError
from granulcal.prior import Prior

if TYPE_CHECKING:
    from granulcal.bayessim.model import BayesSim

__all__ = ["load_model", "save_model"]

FORMAT, VERSION, KIND = "granulcal-bayessim", 1, "mdrff"
_JSON_NAME, _TENSORS_NAME = "model.json", "weights.safetensors"


def save_model(model: "BayesSim", path: str | PathLike[str]) -> None:
    """Writes `model` to the folder `path`; a model already there is replaced as a whole.

    Raises:
        FileExistsError: `path` exists and is not a saved model.
    """
    target = Path(path)
    if target.exists() and not (target / _JSON_NAME).is_file() and not _is_empty(target):
        raise FileExistsError(f"{target} exists and is not a saved model; it is left as it is")
    target.parent.mkdir(parents=True, exist_ok=True)
    workshop = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    new, old = workshop / "new", workshop / "old"
    try:
        new.mkdir()
        text = json.dumps(_document(model), indent=1, allow_nan=False) + "\n"
        (new / _JSON_NAME).write_text(text, encoding="utf-8")
        (new / _TENSORS_NAME).write_bytes(tensor_bytes(_tensors(model)))
        if target.exists():
            os.rename(target, old)
        try:
            os.rename(new, target)
        except OSError:
            if old.exists():
                os.rename(old, target)
            raise
    finally:
        shutil.rmtree(workshop, ignore_errors=True)


def load_model(path: str | PathLike[str]) -> "BayesSim":
    """Returns the model in the folder `path`; see `BayesSim.load`."""
    from granulcal.bayessim.model import BayesSim

    folder = Path(path)
    for name in (_JSON_NAME, _TENSORS_NAME):
        if not (folder / name).is_file():
            raise FileNotFoundError(f"{folder / name} does not exist: {folder} is no saved model")
    where = folder / _JSON_NAME
    try:
        document = json.loads((folder / _JSON_NAME).read_text(encoding="utf-8"))
    except ValueError as error:
        raise ModelFormatError(f"{where} is truncated or not JSON: {error}") from None
    _check_header(document, where)
    try:
        tensors = read_tensors((folder / _TENSORS_NAME).read_bytes())
    except SafetensorError as error:
        raise ModelFormatError(f"{folder / _TENSORS_NAME} is truncated: {error}") from None
    try:
        prior = Prior.from_toml(document["prior_toml"])
        config = Config(**document["config"])
        x_names = tuple(document["x_names"])
        summary = _summary(document["summary"])
        calibration = document["calibration"]
        layout = HeadLayout(config.components, len(prior.names))
        _check_shapes(tensors, _shapes(config, layout, len(x_names)), folder / _TENSORS_NAME)
        return BayesSim(
            prior=prior,
            config=config,
            network=Network(
                layout,
                *(
                    torch.from_numpy(tensors[n])
                    for n in ("frequencies", "linear", "fourier", "bias")
                ),
            ),
            standardiser=Standardiser(
                tensors["x_is_log"].astype(bool),
                *(tensors[name] for name in ("x_shift", "x_scale", "x_low", "x_high")),
            ),
            axes=SignalAxes(tensors["axes_matrix"], tensors["axes_relevance"]),
            target_shift=tensors["target_shift"],
            target_scale=tensors["target_scale"],
            x_names=x_names,
            summary=summary,
            calibration=None if calibration is None else Calibration.from_dict(calibration),
            scene_toml=document["scene_toml"],
        )
    except KeyError as error:
        raise ModelFormatError(f"{where} has no entry {error}") from None
    except (TypeError, PriorError) as error:
        raise ModelFormatError(f"{where}: {error}") from None


def _document(model: "BayesSim") -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "kind": KIND,
        "prior_toml": model.prior.to_toml(),
        "theta_names": model.prior.names,
        "x_names": list(model.x_names),
        "config": model.config.as_dict(),
        "scene_toml": model.scene_toml,
        "scene_hash": model.scene_hash,
        "summary": model.summary.as_dict(),
        "calibration": None if model.calibration is None else model.calibration.as_dict(),
    }


def _tensors(model: "BayesSim") -> dict[str, np.ndarray]:
    network, standardiser = model.network, model.standardiser
    tensors = {
        "frequencies": network.frequencies.numpy(),
        "linear": network.linear.detach().numpy(),
        "fourier": network.fourier.detach().numpy(),
        "bias": network.bias.detach().numpy(),
        "x_is_log": standardiser.is_log.astype(np.uint8),
        "x_shift": standardiser.shift,
        "x_scale": standardiser.scale,
        "x_low": standardiser.low,
        "x_high": standardiser.high,
        "axes_matrix": model.axes.matrix,
        "axes_relevance": model.axes.relevance,
        "target_shift": model.target_shift,
        "target_scale": model.target_scale,
    }
    return {name: np.ascontiguousarray(array) for name, array in tensors.items()}


def _shapes(config: Config, layout: HeadLayout, inputs: int) -> dict[str, tuple[int, ...]]:
    members, p = config.ensemble, layout.dimension
    return {
        "frequencies": (members, config.features, inputs),
        "linear": (members, inputs, layout.size),
        "fourier": (members, 2 * config.features, layout.size),
        "bias": (members, 1, layout.size),
        **{f"x_{name}": (inputs,) for name in ("is_log", "shift", "scale", "low", "high")},
        "axes_matrix": (inputs, inputs),
        "axes_relevance": (inputs,),
        "target_shift": (p,),
        "target_scale": (p,),
    }


def _check_header(document: Any, where: Path) -> None:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ModelFormatError(f"{where} is not a {FORMAT} file")
    for key, expected in (("version", VERSION), ("kind", KIND)):
        if document.get(key) != expected:
            raise ModelFormatError(
                f"{where}: {key} must be {expected!r}, got {document.get(key)!r}"
            )


def _check_shapes(
    tensors: dict[str, np.ndarray], shapes: dict[str, tuple[int, ...]], where: Path
) -> None:
    for name, shape in shapes.items():
        if name not in tensors:
            raise ModelFormatError(f"{where} has no tensor {name}")
        array = tensors[name]
        if array.shape != shape:
            raise ModelFormatError(f"{where}: {name} must have shape {shape}, got {array.shape}")
        if not np.all(np.isfinite(array)):
            raise ModelFormatError(f"{where}: {name} must be finite")


def _summary(values: dict[str, Any]) -> TrainingSummary:
    lists = {
        name: tuple(float("nan") if each is None else each for each in value)
        for name, value in values.items()
        if isinstance(value, list)
    }
    # Processor time is not part of the model: it would make equal models differ.
    return TrainingSummary(**{**values, **lists, "fit_seconds": float("nan")})


def _is_empty(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())
