"""Models of the built-in scenes: one that came with the package, or one that was made here once."""

import hashlib
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from granulcal import _native
from granulcal.bayessim.storage.place import MODEL_JSON, require_place
from granulcal.documents import Table, read_json
from granulcal.files import write_beside
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior
from granulcal.progress import shown
from granulcal.words import did_you_mean

if TYPE_CHECKING:
    from granulcal.pours.dataset import Dataset

__all__ = [
    "cache_folder",
    "find_model",
    "fingerprint",
    "make_model",
    "model_named",
    "require_pours_of",
]

BUILT_IN = ("funnel", "drop")
"""Scenes that a model can be asked for by name."""
_MADE = "made.json"
# What the folder of `generate` holds.
_MANIFEST = "manifest.toml"
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
        if _made(folder / _MADE).get("fingerprint") == wanted:
            return folder
    return None


def _made(path: Path) -> dict[str, object]:
    """Returns what a model's mark says, nothing where there is none or a damaged one."""
    try:
        return read_json(path, Table({}, open=True))
    except (OSError, ValueError):
        return {}


def model_named(name: str | Path) -> Path:
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
                f"{made if (path / _MANIFEST).is_file() else ''}"
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


def make_model(
    name: str,
    *,
    pours: int,
    out: Path | None = None,
    data: Path | None = None,
    compact: bool = False,
    seed: int = 0,
    threads: int | None = None,
    say: Callable[[str], None] = print,
) -> Path:
    """Simulates, trains and checks a model of a built-in scene; returns its folder.

    Stop it anywhere: the same call goes on. A model that is whole and fits is kept as it is.

    Args:
        name: `funnel` or `drop`.
        pours: to train on.
        out: folder of the model; the default is in `cache_folder`.
        data: folder or file of pours that are there already, in place of new ones.
        compact: without the training pours, which `report` wants, and without what `infer` can work
            out in a second: the form in which a model ships.
        seed: of pours and training.
        threads: pours at once; the default is one for each core.
        say: told what is done.

    Raises:
        ValueError: `data` is of another scene, prior or simulator.
    """
    from granulcal.bayessim import BayesSim
    from granulcal.pours.dataset import Dataset, generate

    scene, prior = Scene.built_in(name), Prior.default()
    folder = cache_folder() / "models" / name if out is None else out
    require_place(folder)
    there = None if data is None else Dataset.load(data)
    if there is not None:
        require_pours_of(name, there)
        pours, seed = len(there), there.base_seed
    stamp = fingerprint(scene, prior)
    made = {"fingerprint": stamp, "pours": pours, "seed": seed, "compact": compact}
    path = folder / _MADE
    if _made(path) == made:
        say(f"{folder} is there already")
        return folder
    path.unlink(missing_ok=True)
    if there is None:
        kept = cache_folder() / "pours" / f"{name}-{stamp}-{seed}"
        say(f"1/2 {pours} pours of the scene {name}, kept in {kept}")
        there = generate(scene, prior, pours, seed=seed, out=kept, threads=threads)
    say(f"2/2 training on {pours} pours")
    with shown():
        model = BayesSim.fit(there, seed=seed)
    model.save(folder, compact=compact)
    if not compact:
        there.save(folder / "training.parquet")
    # Last: a folder without it is no model yet.
    write_beside(path, json.dumps(made, indent=1) + "\n")
    return folder


def require_pours_of(name: str, data: "Dataset") -> None:
    """Refuses pours of another scene, prior or simulator than a built-in scene's model needs.

    The simulator is asked: the first usable pour is made again, and must give the same statistics.

    Raises:
        ValueError: what differs.
    """
    scene, prior = Scene.built_in(name), Prior.default()
    if data.scene != scene:
        raise ValueError(f"{data.path} has pours of another scene than {name}: {data.scene.name}")
    if data.prior.to_toml() != prior.to_toml():
        raise ValueError(f"{data.path} was drawn from another prior than the default")
    usable = np.flatnonzero(data.is_usable)
    if not len(usable):
        raise ValueError(f"{data.path} has no usable pour")
    row = int(usable[0])
    numbers = dict(zip(data.theta_names, data.theta[row].tolist(), strict=True))
    again = simulate(scene.with_(numbers), seed=int(data.seed[row])).statistics()
    if not np.array_equal(np.asarray(again), data.paper16[row]):
        raise ValueError(
            f"{data.path} was poured by another simulator ({data.version}): "
            f"its row {row} has other statistics today"
        )
