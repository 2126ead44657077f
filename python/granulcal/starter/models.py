"""Where models are: of a built-in scene the one that was made here, or that came with the package."""

import hashlib
import os
import sys
from os import PathLike
from pathlib import Path

from granulcal import _native
from granulcal.bayessim.storage.place import MODEL_JSON
from granulcal.documents import Table, read_json
from granulcal.pours.scene import BUILT_IN, Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior
from granulcal.words import did_you_mean

__all__ = [
    "MADE",
    "cache_folder",
    "find_model",
    "fingerprint",
    "is_built_in",
    "mark_of",
    "model_named",
]

MADE = "made.json"
"""Mark of such a model: what it was made of."""
_SHIPPED = Path(__file__).parents[1] / "models"


def cache_folder() -> Path:
    """Returns where models are kept: $GRANULCAL_CACHE, else the user's cache of this system."""
    named = os.environ.get("GRANULCAL_CACHE")
    if named:
        return Path(named)
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home())) / "granulcal"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "granulcal"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "granulcal"


def fingerprint(scene: Scene, prior: Prior) -> str:
    """Returns what a model of a scene depends on: scene, prior, and the simulator to the last bit.

    The simulator is known by where the grains of a small pour end: a model that was made before
    the contact law changed is not taken for one of today.
    """
    pour = simulate(Scene.drop(0.03, count=40, preset="fast"), seed=1)
    ends = pour.positions.tobytes() + pour.velocities.tobytes()
    state = hashlib.sha256(ends).hexdigest()
    text = "\n".join([scene.to_toml(), prior.to_toml(), state, _native.__version__])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def find_model(name: str) -> Path | None:
    """Returns the folder of a built-in scene's model that fits this simulator, None if there is none."""
    wanted = fingerprint(Scene.built_in(name), Prior.default())
    for folder in (cache_folder() / "models" / name, _SHIPPED / name):
        if mark_of(folder / MADE).get("fingerprint") == wanted:
            return folder
    return None


def mark_of(path: Path) -> dict[str, object]:
    """Returns what a model's mark says, nothing where there is none or a damaged one."""
    try:
        return read_json(path, Table({}, open=True))
    except (OSError, ValueError):
        return {}


def is_built_in(name: str | PathLike[str]) -> bool:
    """Returns whether this is the name of a built-in scene, and of nothing that is here."""
    return str(name) in BUILT_IN and not Path(name).exists()


def model_named(name: str | PathLike[str]) -> Path:
    """Returns the folder of a model that a command line names: a folder, or a built-in scene.

    Raises:
        FileNotFoundError: nothing of this name, a folder of something else, or a built-in scene of
            which there is no model yet.
        NotADirectoryError: it is a file.
    """
    path, allowed = Path(name), f"the folder of a model, or {' or '.join(BUILT_IN)}"
    if path.is_dir():
        if not (path / MODEL_JSON).exists():
            made = f"; `granulcal train {name} -o model` makes one of these pours"
            raise FileNotFoundError(
                f"{name} holds no {MODEL_JSON}; asked for is {allowed}"
                f"{made if (path / _native.MANIFEST).is_file() else ''}"
            )
        return path
    if path.exists():
        raise NotADirectoryError(f"{name} is a file; asked for is {allowed}")
    if str(name) not in BUILT_IN:
        meant = did_you_mean(str(name), BUILT_IN)
        raise FileNotFoundError(f"there is no {name}; asked for is {allowed}{meant}")
    found = find_model(str(name))
    if found is None:
        raise FileNotFoundError(
            f"there is no model of the scene {name} for this simulator yet: "
            f"`granulcal model {name}` makes it once"
        )
    return found
