"""Makes the model of a built-in scene, from pours of here or elsewhere."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from granulcal.bayessim.storage.place import require_place
from granulcal.files import write_beside
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior
from granulcal.progress import shown
from granulcal.starter.models import MADE, cache_folder, fingerprint, mark_of

if TYPE_CHECKING:
    from granulcal.pours.dataset import Dataset

__all__ = ["make_model", "require_pours_of"]


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
    path = folder / MADE
    if mark_of(path) == made:
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
