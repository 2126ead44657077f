"""A trained model as a folder: model.json and weights.safetensors, never pickle."""

import json
import os
import shutil
import tempfile
import warnings
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load as read_tensors
from safetensors.numpy import save as tensor_bytes

from granulcal import _native
from granulcal.bayessim.check.calibration import Calibration
from granulcal.bayessim.check.identifiability import Identifiability
from granulcal.bayessim.posterior.average import FORMS, Average
from granulcal.bayessim.storage.damage import hashes, in_order, verify
from granulcal.bayessim.storage.model_document import (
    FORMAT,
    OLDER_VERSIONS,
    VERSION,
    read_model_document,
)
from granulcal.bayessim.storage.parts import Parts, Trained
from granulcal.bayessim.storage.place import MODEL_JSON, require_place
from granulcal.bayessim.storage.tensors import Tensors, model_tensors
from granulcal.bayessim.training.config import Config
from granulcal.bayessim.training.summary import TrainingSummary
from granulcal.documents import read_bytes
from granulcal.errors import ModelFormatError, OtherLawWarning, UnverifiedModelWarning
from granulcal.files import write_beside
from granulcal.prior import Prior

__all__ = ["Parts", "load_parts", "save_model"]

_TENSORS_NAME = "weights.safetensors"


def save_model(model: Trained, path: str | PathLike[str], *, compact: bool = False) -> None:
    """Writes `model` to the folder `path`; a model already there is replaced, other files stay.

    Raises:
        FileExistsError: `path` exists and is not a saved model.
    """
    # A link to a folder stays a link.
    target = Path(path).resolve() if Path(path).is_symlink() else Path(path)
    require_place(target)
    target.parent.mkdir(parents=True, exist_ok=True)
    workshop = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
    new, old = workshop / "new", workshop / "old"
    try:
        new.mkdir()
        text = (json.dumps(_document(model), indent=1, allow_nan=False) + "\n").encode()
        tensors = model_tensors(model, compact=compact)
        write_beside(new / MODEL_JSON, text)
        write_beside(
            new / _TENSORS_NAME, in_order(tensor_bytes(tensors, metadata=hashes(text, tensors)))
        )
        if target.exists():
            os.rename(target, old)
        os.rename(new, target)
    finally:
        # Wherever Ctrl-C stops it, what was there is in its place before the rest is removed.
        if old.exists() and not target.exists():
            os.rename(old, target)
        _keep_others(old, target)
        shutil.rmtree(workshop, ignore_errors=True)


def load_parts(path: str | PathLike[str]) -> Parts:
    """Returns what the model in the folder `path` is joined from; see `BayesSim.load`."""
    folder = Path(path)
    for name in (MODEL_JSON, _TENSORS_NAME):
        if not (folder / name).is_file():
            raise FileNotFoundError(f"{folder / name} does not exist: {folder} is no saved model")
    where = folder / MODEL_JSON
    text, document = read_model_document(folder)
    data = read_bytes(folder / _TENSORS_NAME)
    try:
        tensors = read_tensors(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise ModelFormatError(f"{folder / _TENSORS_NAME} is truncated: {error}") from None
    if not verify(text, where, data, tensors, folder / _TENSORS_NAME):
        warnings.warn(
            f"{folder} is a model of an earlier version without hashes: damage in it cannot be "
            "found; train again to have them",
            UnverifiedModelWarning,
            stacklevel=3,
        )
    law = document.get("law")
    # A model of pairs that were handed in states that it is of no law; 0 is another simulator's.
    is_older = "law" not in document and document["scene_toml"] is not None
    today = _native.law_of(document["scene_toml"])
    if is_older or law not in (None, 0, today):
        named = "one of before laws had numbers" if law is None else f"law {law}"
        warnings.warn(
            f"{folder} was trained on pours of another law of the solver, {named}, which is not "
            f"today's {today}: train again",
            OtherLawWarning,
            stacklevel=3,
        )
    try:
        prior = Prior.from_toml(document["prior_toml"])
        config = Config(**document["config"])
        x_names = tuple(document["x_names"])
        tensors = Tensors(tensors, folder / _TENSORS_NAME, len(prior.names), len(x_names))
        calibration, known = document["calibration"], document["identifiability"]
        average = _average(document, where)
        if calibration is not None:
            # Files of before it was stated: where an emulator counts, its folds were the check.
            calibration = {"chose_form": average.emulator > 0, **calibration}
        return Parts(
            prior=prior,
            config=config,
            standardiser=tensors.standardiser(),
            likelihood=tensors.likelihood(prior, config, document["emulator"]),
            amortised=tensors.amortised(config) if document["has_network"] else None,
            average=average,
            x_names=x_names,
            misfit_reference=tensors.misfit(),
            identifiability=None if known is None else Identifiability.from_dict(known),
            summary=TrainingSummary.from_dict(document["summary"]),
            calibration=None if calibration is None else Calibration.from_dict(calibration),
            scene_toml=document["scene_toml"],
            law=document.get("law"),
        )
    except KeyError as error:
        raise ModelFormatError(f"{where} has no entry {error}") from None
    except ModelFormatError:
        raise
    except (TypeError, ValueError, IndexError, OverflowError, np.linalg.LinAlgError) as error:
        raise ModelFormatError(f"{where}: {error}") from None


def _keep_others(old: Path, target: Path) -> None:
    """Moves what else lay in the folder of the model before: plots, reports, notes."""
    if not old.is_dir():
        return
    for entry in old.iterdir():
        if not (target / entry.name).exists():
            os.rename(entry, target / entry.name)


def _document(model: Trained) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"granulcal {_native.__version__}",
        "prior_toml": model.prior.to_toml(),
        "theta_names": model.prior.names,
        "x_names": list(model.x_names),
        "config": model.config.as_dict(),
        "scene_toml": model.scene_toml,
        "scene_hash": model.scene_hash,
        "law": model.law,
        "has_network": model.amortised is not None,
        "average": model.average.form,
        "emulator_weight": model.average.emulator,
        "network_weight": model.average.network,
        "emulator": model.likelihood.scalars(),
        "is_calibrated": None if model.calibration is None else model.calibration.is_calibrated,
        "summary": model.summary.as_dict(),
        "identifiability": None
        if model.identifiability is None
        else model.identifiability.as_dict(),
        "calibration": None if model.calibration is None else model.calibration.as_dict(),
    }


def _average(document: dict[str, Any], where: Path) -> Average:
    weight = document["emulator_weight"]
    if document["version"] in OLDER_VERSIONS:
        found = Average(weight, 1 - weight, "arithmetic")
    else:
        found = Average(weight, document["network_weight"], document["average"])
    if found.form not in FORMS:
        raise ModelFormatError(
            f"{where}: average must be one of {', '.join(FORMS)}, got {found.form!r}"
        )
    weights = {"emulator_weight": found.emulator, "network_weight": found.network}
    for name, value in weights.items():
        if not 0 <= value < float("inf") or (found.form == "arithmetic" and value > 1):
            raise ModelFormatError(f"{where}: {name} must be a weight, got {value!r}")
    if found.emulator + found.network == 0 or (found.network > 0 and not document["has_network"]):
        raise ModelFormatError(
            f"{where}: one weight must be positive, and the network's 0 without a network, got "
            f"{found.emulator!r} and {found.network!r}"
        )
    return found
