"""Where an experiment gets its pours and models: kept on disk, never made twice, and counted."""

import hashlib
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.arrays import read_array
from granulcal.cores import cores
from granulcal.engines.in_use import law_of_pours
from granulcal.errors import NotOfPriorWarning
from granulcal.experiments.paper.common.outcome import Outcome
from granulcal.experiments.paper.common.sizes import Size
from granulcal.files import write_beside
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.kept_pours import KeptPours
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour, simulate
from granulcal.prior import Prior
from granulcal.progress import ProgressLine

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim

__all__ = ["Pairs", "Workshop"]

Array = NDArray[np.float64]
Look = tuple[tuple[str, ...], Callable[[Pour], ArrayLike]]


@dataclass(frozen=True, eq=False)
class Pairs:
    """Parameters and what was seen of their pours, the usable ones.

    Attributes:
        theta: own units, shape (n, p).
        x: statistics, shape (n, s).
        prior: that names the parameters.
        names: of the statistics.
        unusable: pours besides that could not be used, by why.
    """

    theta: Array
    x: Array
    prior: Prior
    names: tuple[str, ...]
    unusable: LeftOut

    def first(self, count: int) -> "Pairs":
        """Returns the first so many."""
        return Pairs(self.theta[:count], self.x[:count], self.prior, self.names, self.unusable)

    def of(self, names: Sequence[str]) -> "Pairs":
        """Returns the pairs with these statistics alone."""
        columns = [self.names.index(name) for name in names]
        kept = self.x[:, columns]
        return Pairs(self.theta, kept, self.prior, tuple(names), self.unusable)

    def __len__(self) -> int:
        return len(self.theta)


@dataclass
class Workshop:
    """The folder of a run, its size, and what the running experiment has used.

    Attributes:
        folder: of all experiments.
        name: of the running experiment.
        size: how large it is.
        threads: pours at once.
        quiet: whether nothing is printed.
        pours: pours that the experiment rests on.
        cpu_s: processor time of these pours [s].
        seeds: seed of each set, by name.
        so_far: keeps what an experiment has found before its last part is run.
    """

    folder: Path
    name: str
    size: Size
    threads: int = field(default_factory=cores)
    quiet: bool = False
    pours: int = 0
    cpu_s: float = 0.0
    seeds: dict[str, int] = field(default_factory=dict)
    so_far: Callable[[Outcome], object] = lambda _: None

    @property
    def own(self) -> Path:
        """Folder of the experiment's results and pictures."""
        path = self.folder / self.name
        path.mkdir(parents=True, exist_ok=True)
        return path

    def say(self, text: str) -> None:
        """Prints a line."""
        if not self.quiet:
            print(f"  {text}", flush=True)

    def data(self, name: str, scene: Scene, prior: Prior, count: int, seed: int) -> Dataset:
        """Returns `count` pours with parameters drawn from `prior`; several experiments may share.

        Args:
            name: of the set; its folder below `pours`.
            scene: what is poured.
            prior: what is drawn.
            count: pours.
            seed: of the set.
        """
        folder = self.folder / "pours" / name
        self.say(f"{name}: {count} pours")
        data = generate(
            scene,
            prior,
            count,
            seed=seed,
            out=folder,
            threads=self.threads,
            progress=not self.quiet,
        )
        self.pours += len(data)
        self.cpu_s += float(np.sum(data.health["cpu_s"]))
        self.seeds[name] = seed
        return data

    def pairs(self, name: str, scene: Scene, prior: Prior, count: int, seed: int) -> Pairs:
        """Returns the usable ones among `count` pours: a training set."""
        return _usable(self.data(name, scene, prior, count, seed))

    def tests(self, name: str, scene: Scene, prior: Prior, count: int, seed: int) -> Pairs:
        """Returns exactly `count` usable pours; as many more are made as are not usable."""
        return self.enough(count, lambda n: self.pairs(name, scene, prior, n, seed))

    def enough(self, count: int, pour: Callable[[int], Pairs]) -> Pairs:
        """Returns the first `count` usable pours of `pour`, which is asked for more until they are.

        Args:
            count: how many.
            pour: makes so many pours, the first of which are there already, and returns the usable.
        """
        wanted = count
        while True:
            pours, cpu_s = self.pours, self.cpu_s
            found = pour(wanted)
            if len(found) >= count:
                return found.first(count)
            self.pours, self.cpu_s = pours, cpu_s
            wanted += count - len(found)

    def poured(
        self,
        name: str,
        scene: Scene,
        prior: Prior,
        theta: Array,
        *,
        seed: int,
        look: Look | None = None,
        observed: bool = False,
    ) -> Array:
        """Returns what pours at `theta` (n, p) show, shape (n, s); NaN where they cannot be used.

        Args:
            name: of the set; its file below `pours`.
            scene: what is poured.
            prior: names the parameters.
            theta: own units.
            seed: of the set; row i has a seed of its own.
            look: names and function of what is kept, in place of the 16 statistics.
            observed: keep what the scene observes.
        """
        path = self.folder / "pours" / f"{name}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        kept = KeptPours(
            scene, prior, path, seed=seed, threads=self.threads, look=look, observed=observed
        )
        resumed, total = kept.kept_of(theta), len(theta)
        self.say(f"{name}: {total} pours")
        line = None if self.quiet else ProgressLine()
        if line is not None:
            kept.progress = lambda done: line(
                total, resumed, max(done - resumed, 0), *kept.left_out(total).counts
            )
        try:
            x = kept(theta, 0)
        finally:
            if line is not None:
                line.close()
        self.pours += total
        self.cpu_s += sum(kept.rows[str(i)].get("cpu_s", 0.0) for i in range(total))
        self.seeds[name] = seed
        return x

    def formation(self, scene: Scene, seed: int) -> Array:
        """Returns the points of a pour's image, shape (n, 3) [m], for a picture: poured once."""
        pour = f"{law_of_pours(scene)} {seed}\n{scene.to_toml()}"
        name = hashlib.sha256(pour.encode()).hexdigest()[:16]
        path = self.folder / "pours" / "formations" / f"{name}.npy"
        if path.exists():
            return read_array(path)
        points = simulate(scene, seed=seed).points()
        buffer = BytesIO()
        np.save(buffer, points)
        write_beside(path, buffer.getvalue())
        return points

    def model(self, name: str, pairs: Pairs, *, seed: int = 0, **config: Any) -> "BayesSim":
        """Returns the model of these pairs, trained once and kept below `models`."""
        from granulcal.bayessim import BayesSim

        settings = {**self.size.fit, **config}
        folder = self.folder / "models" / name
        key = _key(pairs, seed, settings)
        mark = folder / "pairs.sha256"
        if mark.exists() and mark.read_text(encoding="utf-8") == key:
            return BayesSim.load(folder)
        began = time.monotonic()
        with warnings.catch_warnings():
            # Pours that cannot be used have been left out, and their materials are not any.
            warnings.simplefilter("ignore", NotOfPriorWarning)
            model = BayesSim.fit(
                pairs.theta,
                pairs.x,
                pairs.prior,
                seed,
                x_names=pairs.names,
                quiet=True,
                **settings,
            )
        model.save(folder)
        write_beside(mark, key)
        self.say(f"model {name}: {len(pairs)} pours, {time.monotonic() - began:.0f} s")
        return model


def _usable(data: Dataset) -> Pairs:
    kept = data.is_usable
    return Pairs(data.theta[kept], data.x[kept], data.prior, data.x_names, data.left_out)


def _key(pairs: Pairs, seed: int, settings: dict[str, Any]) -> str:
    digest = hashlib.sha256(f"{seed} {sorted(settings.items())} {pairs.names}".encode())
    digest.update(pairs.prior.to_toml().encode())
    for array in (pairs.theta, pairs.x):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()
