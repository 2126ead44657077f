"""Models of the built-in scenes: one that came with the package, or one that was made here once."""

import hashlib
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path

from granulcal import _native
from granulcal.files import write_beside
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior

__all__ = ["cache_folder", "find_model", "fingerprint", "make_model", "model_named"]

BUILT_IN = ("funnel", "drop")
"""Scenes that a model can be asked for by name."""
_MADE = "made.json"
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

    The simulator is known by the final state of a small pour: a model that was made before the
    contact law changed is not taken for one of today.
    """
    state = simulate(Scene.drop(0.03, count=40, preset="fast"), seed=1).state_hash
    text = "\n".join([scene.to_toml(), prior.to_toml(), state, _native.__version__])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def find_model(name: str) -> Path | None:
    """Returns the folder of a built-in scene's model that fits this simulator, None if there is none."""
    wanted = fingerprint(Scene.built_in(name), Prior.default())
    for folder in (cache_folder() / "models" / name, _SHIPPED / name):
        try:
            made = json.loads((folder / _MADE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if made.get("fingerprint") == wanted:
            return folder
    return None


def model_named(name: str | Path) -> Path:
    """Returns the folder of a model that a command line names: a folder, or a built-in scene.

    Raises:
        FileNotFoundError: a built-in scene of which there is no model yet.
    """
    if str(name) not in BUILT_IN or Path(name).exists():
        return Path(name)
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
        seed: of pours and training.
        threads: pours at once; the default is one for each core.
        say: told what is done.
    """
    from granulcal.bayessim import BayesSim
    from granulcal.pours.dataset import generate

    scene, prior = Scene.built_in(name), Prior.default()
    folder = cache_folder() / "models" / name if out is None else out
    made = {"fingerprint": fingerprint(scene, prior), "pours": pours, "seed": seed}
    path = folder / _MADE
    if path.exists() and json.loads(path.read_text(encoding="utf-8")) == made:
        say(f"{folder} is there already")
        return folder
    path.unlink(missing_ok=True)
    kept = cache_folder() / "pours" / f"{name}-{made['fingerprint']}-{seed}"
    say(f"1/2 {pours} pours of the scene {name}, kept in {kept}")
    data = generate(scene, prior, pours, seed=seed, out=kept, threads=threads)
    say("2/2 training")
    model = BayesSim.fit(data, seed=seed)
    model.save(folder)
    data.save(folder / "training.parquet")
    # Last: a folder without it is no model yet.
    write_beside(path, json.dumps(made, indent=1) + "\n")
    return folder
