"""`inspect` of models and posteriors; whatever else it is given is read by granulcal-cli."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from granulcal import _native
from granulcal.bayessim.storage.model_document import read_model_document
from granulcal.bayessim.storage.place import MODEL_JSON
from granulcal.commands.exit_code import DONE
from granulcal.commands.reading import TRAINING
from granulcal.design.posterior_file import POSTERIOR_JSON
from granulcal.documents import Flag, ListOf, Mapping, Maybe, Number, Table, Text, read_json
from granulcal.files import DATA_SET
from granulcal.pours.scene import Scene
from granulcal.prior import Prior
from granulcal.starter.models import is_built_in, model_named

__all__ = ["is_asked", "run"]

_FLAGS = {"--json", "-q", "--quiet", "-v", "-vv", "--verbose"}
_NUMBERS = {"mode": Number(), "mean": Number(), "interval90": ListOf(Number(), least=2)}
_POSTERIOR = Table(
    {"recordings": ListOf(Text()), "parameters": Maybe(Mapping(Table(_NUMBERS, open=True)))},
    {
        "fixed": Mapping(Number()),
        "scene_toml": Maybe(Text()),
        "inside_model": Table(
            {"is_inside": Flag()},
            {"p_value": Maybe(Number()), "impossible": ListOf(Text())},
            open=True,
        ),
        "calibrated": Flag(),
        "pours": Number(),
        "usable": Number(),
        "warnings": ListOf(Text()),
        "samples": ListOf(ListOf(Number())),
    },
    open=True,
)


def is_asked(words: Sequence[str]) -> bool:
    """Returns whether the words ask `inspect` for a model, a posterior or the folder of one."""
    given = [word for word in words[1:] if word not in _FLAGS]
    if words[:1] != ["inspect"] or len(given) != 1:
        return False
    return is_built_in(given[0]) or _what(Path(given[0])) is not None


def run(words: Sequence[str]) -> int:
    """Says what is in it; returns the exit code.

    Raises:
        FileNotFoundError: a built-in scene of which there is no model.
        ValueError: the document is no model's or no posterior's, or is damaged.
    """
    given = next(word for word in words[1:] if word not in _FLAGS)
    path = model_named(given) if is_built_in(given) else Path(given)
    facts = _of_model(path) if _what(path) == MODEL_JSON else _of_posterior(path)
    if "--json" in words:
        print(json.dumps(facts, indent=1))
    else:
        print("\n".join(_lines(facts)))
    return DONE


def _what(path: Path) -> str | None:
    """The name of the document that is inspected; None for what is granulcal-cli's to read."""
    if path.is_file() and path.suffix.lower() == ".json":
        return MODEL_JSON if path.name == MODEL_JSON else POSTERIOR_JSON
    if (path / DATA_SET).is_file():
        # Of a data set, whatever else lies in its folder.
        return None
    documents = (MODEL_JSON, POSTERIOR_JSON)
    return next((name for name in documents if (path / name).is_file()), None)


def _of_model(path: Path) -> dict[str, Any]:
    folder = path if path.is_dir() else path.parent
    _, document = read_model_document(folder)
    summary, prior = document["summary"], Prior.from_toml(document["prior_toml"])
    return {
        "kind": "model",
        "made by": document.get("made_by"),
        "estimator": summary["method"],
        "chosen": [line.strip() for line in summary["choice"].splitlines()],
        "pours": summary["pair_count"],
        "pours left out": {why: count for why, count in summary["excluded"].items() if count},
        "training pours": (folder / TRAINING).is_file(),
        "law": document.get("law"),
        "scene": _of_scene(document["scene_toml"]),
        "prior": {each.path: each.in_words for each in prior.parameters},
        "statistics": document["x_names"],
        "calibrated": document.get("is_calibrated"),
        "coverage": _coverage(document["calibration"]),
    }


def _of_scene(text: str | None) -> dict[str, Any] | None:
    if text is None:
        return None
    try:
        scene = Scene.from_toml(text)
    except ValueError as error:
        # It may name meshes that are not here.
        return {"not readable here": str(error)}
    grains = {"grains": scene.get("grains.count")} if scene.has("grains.count") else {}
    grains |= {"diameter_m": scene.get("grains.diameter")}
    return {"name": scene.name, "preset": scene.preset, **grains}


def _coverage(calibration: dict[str, Any] | None) -> dict[str, str] | None:
    """Truths in regions of the check that is stored."""
    if calibration is None:
        return None
    return {
        f"{each['level']:.0%} region": f"{each['inside']} of {each['total']} truths, "
        f"chance allows {each['low']} to {each['high']}"
        for each in calibration["counts"]
    }


def _of_posterior(path: Path) -> dict[str, Any]:
    try:
        document = read_json(path / POSTERIOR_JSON if path.is_dir() else path, _POSTERIOR)
    except ValueError as error:
        allowed = "of JSON a model's document and what `infer -o` or `calibrate` writes"
        raise ValueError(f"{error}; {allowed} can be inspected") from None
    known: dict[str, Any] = {"kind": "posterior"}
    names = ("recordings", "parameters", "fixed", "inside_model", "calibrated", "pours", "usable")
    known |= {name: document[name] for name in (*names, "warnings") if name in document}
    if "scene_toml" in document:
        known["scene"] = _of_scene(document["scene_toml"])
    parameters = document["parameters"]
    if parameters is not None:
        known["parameters"] = {
            name: {key: each[key] for key in _NUMBERS} for name, each in parameters.items()
        }
    inside = ("is_inside", "p_value", "impossible")
    if "inside_model" in known:
        kept = {key: each for key, each in document["inside_model"].items() if key in inside}
        known["inside_model"] = kept
    return {**known, "samples": len(document.get("samples", []))}


def _lines(facts: dict[str, Any], indent: str = "") -> list[str]:
    """Facts as indented lines, as granulcal-cli writes them; texts of files steer no terminal."""
    found: list[str] = []
    for key, value in facts.items():
        if isinstance(value, dict) and value:
            found += [_readable(f"{indent}{key}:"), *_lines(value, f"{indent}  ")]
        elif isinstance(value, list) and any(" " in str(each) for each in value):
            found += [f"{indent}{key}:", *(_readable(f"{indent}  {each}") for each in value)]
        elif isinstance(value, list):
            between = " to " if key == "interval90" else ", "
            told = between.join(_number(each) for each in value) or "none"
            found.append(_readable(f"{indent}{key}: {told}"))
        else:
            found.append(_readable(f"{indent}{key}: {_number(value)}"))
    return found


def _number(value: Any) -> str:
    """A value for people."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None or value == {}:
        return "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _readable(line: str) -> str:
    return _native.readable(line)
