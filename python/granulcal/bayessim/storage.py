"""A trained model as a folder: model.json and weights.safetensors, never pickle."""

import json
import os
import shutil
import tempfile
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from safetensors import SafetensorError
from safetensors.numpy import load as read_tensors
from safetensors.numpy import save as tensor_bytes

from granulcal import _native
from granulcal.bayessim.calibration import Calibration
from granulcal.bayessim.config import Config
from granulcal.bayessim.summary import TrainingSummary
from granulcal.bayessim.tensors import Tensors, model_tensors
from granulcal.errors import ModelFormatError, PriorError
from granulcal.identifiability import Identifiability
from granulcal.prior import Prior

if TYPE_CHECKING:
    from granulcal.bayessim.model import BayesSim

__all__ = ["load_model", "save_model"]

FORMAT, VERSION = "granulcal-bayessim", 3
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
        (new / _TENSORS_NAME).write_bytes(tensor_bytes(model_tensors(model)))
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
        tensors = Tensors(tensors, folder / _TENSORS_NAME, len(prior.names), len(x_names))
        calibration, known = document["calibration"], document["identifiability"]
        return BayesSim(
            prior=prior,
            config=config,
            standardiser=tensors.standardiser(),
            likelihood=tensors.likelihood(prior, config, document["emulator"]),
            amortised=tensors.amortised(config) if document["has_network"] else None,
            emulator_weight=document["emulator_weight"],
            x_names=x_names,
            misfit_reference=tensors.misfit(),
            identifiability=None if known is None else Identifiability.from_dict(known),
            summary=TrainingSummary.from_dict(document["summary"]),
            calibration=None if calibration is None else Calibration.from_dict(calibration),
            scene_toml=document["scene_toml"],
        )
    except KeyError as error:
        raise ModelFormatError(f"{where} has no entry {error}") from None
    except (TypeError, PriorError) as error:
        raise ModelFormatError(f"{where}: {error}") from None


def _document(model: "BayesSim") -> dict[str, Any]:
    likelihood = model.likelihood
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
        "has_network": model.amortised is not None,
        "emulator_weight": model.emulator_weight,
        "emulator": {
            "widening": likelihood.widening,
            "degrees": likelihood.emulator.noise.degrees,
            "leading_degrees": likelihood.leading.noise.degrees,
            "axis_count": likelihood.axis_count,
        },
        "is_calibrated": None if model.calibration is None else model.calibration.is_calibrated,
        "summary": model.summary.as_dict(),
        "identifiability": None
        if model.identifiability is None
        else model.identifiability.as_dict(),
        "calibration": None if model.calibration is None else model.calibration.as_dict(),
    }


def _check_header(document: Any, where: Path) -> None:
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise ModelFormatError(f"{where} is not a {FORMAT} file")
    found = document.get("version")
    if found != VERSION:
        made_by = document.get("made_by", "an earlier granulcal")
        newer = isinstance(found, int) and found > VERSION
        advice = "update granulcal" if newer else "train the model again"
        raise ModelFormatError(
            f"{where}: version must be {VERSION} (granulcal {_native.__version__}), got {found!r} "
            f"(made by {made_by}): {advice}"
        )


def _is_empty(path: Path) -> bool:
    return path.is_dir() and not any(path.iterdir())
