"""Height of the funnel from the radii of a ring: pours, BayesSim, and what they can reach."""

from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.storage.place import require_place
from granulcal.bayessim.training.own_pours import require_own_pours
from granulcal.design.reach import Reach
from granulcal.design.ring import PERCENTILES, STATISTICS
from granulcal.errors import TrainingDataError
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim

__all__ = ["HEIGHT", "HeldOut", "RingModel", "height_prior"]

Array = NDArray[np.float64]

HEIGHT = "funnel.height"
"""Path of the height that is designed."""
_MODEL, _POURS, _HELD_OUT = "model", "pours", "held-out"
_TRAINING = "training.parquet"
# A model needs as many usable pours, and one that is held out has no spread.
_FEWEST_POURS, _FEWEST_HELD_OUT = 50, 2


@dataclass(frozen=True)
class HeldOut:
    """Heights inferred from pours that were not trained on.

    Attributes:
        heights: true heights [m], shape (n,).
        means: posterior means [m], shape (n,).
        intervals: central 90 % intervals [m], shape (n, 2).
        floors: least standard deviation that the pours' own noise allows there [m], shape (n,).
        unusable: pours besides that could not be used, by why.
    """

    heights: Array
    means: Array
    intervals: Array
    floors: Array
    unusable: LeftOut

    @property
    def errors(self) -> Array:
        """Mean of the posterior less the truth [m], shape (n,)."""
        return self.means - self.heights

    @property
    def coverage(self) -> float:
        """Share of the truths that their 90 % intervals hold."""
        low, high = self.intervals.T
        return float(np.mean((low <= self.heights) & (self.heights <= high)))

    def __str__(self) -> str:
        """One paragraph, centimetres."""
        e = 100 * self.errors
        floor = 100 * float(np.sqrt(np.mean(self.floors**2)))
        return (
            f"height of {len(e)} pours that were not trained on (besides, not usable: "
            f"{self.unusable}): error {e.mean():+.4f} ± {e.std(ddof=1):.4f} cm, mean absolute "
            f"{np.abs(e).mean():.4f} cm, largest {np.abs(e).max():.3f} cm;\n"
            f"pours of one height differ by as much as {floor:.4f} cm of height (rms); "
            f"90 % intervals hold {self.coverage:.0%}"
        )


class RingModel:
    """A model of the funnel's height given the two radii, with the pours that it was trained on.

    Attributes:
        bayes: posterior of the height.
        reach: what heights give, from the usable pours.
        scene: the scene of the pours; its material is that of the plan.
        pour_count: pours simulated, the unusable ones too.
        unusable: those, by why.
        seed: of the pours' data set.
    """

    def __init__(self, bayes: "BayesSim", data: Dataset) -> None:
        """Joins a model and its data set; use `train` or `load`.

        Raises:
            TrainingDataError: parameters other than the height, or other statistics.
        """
        if bayes.prior.names != [HEIGHT] or tuple(bayes.x_names) != STATISTICS:
            raise TrainingDataError(
                f"a model for rings infers {HEIGHT} from {', '.join(STATISTICS)}; this one infers "
                f"{', '.join(bayes.prior.names)} from {', '.join(bayes.x_names)}"
            )
        self.bayes, self.scene, self.pour_count = bayes, data.scene, len(data)
        self.unusable, self.seed = data.left_out, data.base_seed
        usable = data.is_usable
        self.reach = Reach(data.theta[usable, 0], data.x[usable])

    @property
    def fails_its_check(self) -> bool:
        """Whether the check on pours that were left out found the model's intervals wrong."""
        calibration = self.bayes.calibration
        return calibration is not None and not calibration.is_calibrated

    def __str__(self) -> str:
        """What it was trained on."""
        low, high = 100 * self.reach.low, 100 * self.reach.high
        return (
            f"model of {self.pour_count} pours, {len(self.reach.heights)} of them usable, from "
            f"heights of {low:.2f} to {high:.2f} cm"
        )

    @classmethod
    def train(
        cls,
        scene: Scene,
        *,
        heights: tuple[float, float] = (0.01, 0.13),
        pours: int = 400,
        out: str | PathLike[str] | None = None,
        seed: int = 0,
        threads: int | None = None,
        progress: bool = True,
    ) -> "RingModel":
        """Returns a model of pours from uniformly drawn heights; a folder `out` is resumed.

        Args:
            scene: a pour through a funnel, with the material of the plan.
            heights: lowest and highest height of the funnel's tip [m].
            pours: how many, at least 50 of them usable.
            out: folder for pours and model; the default keeps the pours in a temporary folder.
            seed: seed of heights, pours and training.
            threads: pours at once; the default is one for each core.
            progress: show pours on stderr.

        Raises:
            ValueError: fewer than 50 pours are asked for, or the scene does not fit.
            TrainingDataError: fewer than 50 of them are usable.
        """
        from granulcal.bayessim import BayesSim

        if pours < _FEWEST_POURS:
            raise ValueError(f"pours must be at least {_FEWEST_POURS}, got {pours}")
        folder = None if out is None else Path(out)
        if folder is not None:
            require_place(folder / _MODEL)
        data = generate(
            observing_radii(scene),
            height_prior(heights),
            pours,
            seed=seed,
            out=None if folder is None else folder / _POURS,
            threads=threads,
            progress=progress,
        )
        if folder is not None and _is_trained(folder / _MODEL, data):
            return cls.load(folder / _MODEL)
        bayes = BayesSim.fit(data, seed=seed, quiet=True)
        if folder is not None:
            bayes.save(folder / _MODEL)
            data.save(folder / _MODEL / _TRAINING)
        return cls(bayes, data)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "RingModel":
        """Returns the model in a folder of `train`, here or on the command line.

        Raises:
            FileNotFoundError: the folder or its training data does not exist.
            TrainingDataError: it is a model of something else, or of other pours.
        """
        from granulcal.bayessim import BayesSim

        inside = Path(path) / _MODEL
        folder = inside if inside.is_dir() else Path(path)
        bayes, data = BayesSim.load(folder), Dataset.load(folder / _TRAINING)
        require_own_pours(bayes, data, folder / _TRAINING)
        return cls(bayes, data)

    def held_out(
        self,
        count: int = 50,
        *,
        seed: int,
        out: str | PathLike[str] | None = None,
        threads: int | None = None,
        progress: bool = True,
    ) -> HeldOut:
        """Returns heights inferred from `count` usable pours at fresh heights of the prior.

        Args:
            count: usable pours, at least two; others are made and counted besides.
            seed: another one than that of the training's pours, which would be made again.
            out: folder of a ring model; its subfolder `held-out` keeps the pours.
            threads: pours at once.
            progress: show pours on stderr.

        Raises:
            ValueError: fewer than two, or the seed of the training's pours.
        """
        if count < _FEWEST_HELD_OUT:
            raise ValueError(f"count must be at least {_FEWEST_HELD_OUT}, got {count}")
        if seed == self.seed:
            raise ValueError(f"seed must be another than that of the training's pours, got {seed}")
        folder = None if out is None else Path(out) / _HELD_OUT
        wanted, data = count, None
        while data is None or data.is_usable.sum() < count:
            wanted += 0 if data is None else count - int(data.is_usable.sum())
            data = generate(
                self.scene,
                self.bayes.prior,
                wanted,
                seed=seed,
                out=folder,
                threads=threads,
                progress=progress,
            )
            folder = data.path
        return self.check(data)

    def check(self, data: Dataset) -> HeldOut:
        """Returns heights inferred from the usable pours of a data set that was not trained on.

        Raises:
            ValueError: it was.
        """
        usable = data.is_usable
        heights, radii = data.theta[usable, 0], data.x[usable]
        trained, own = (
            set(map(tuple, np.column_stack(pours).tolist()))
            for pours in ((self.reach.heights, self.reach.radii), (heights, radii))
        )
        if seen := len(trained & own):
            raise ValueError(
                f"{seen} of the {len(heights)} pours that are to check the model are those that it "
                "was trained on: another seed makes others"
            )
        posteriors = [self.bayes.posterior(row) for row in radii]
        return HeldOut(
            heights=heights,
            means=np.array([p.mean()[0] for p in posteriors]),
            intervals=np.array([p.credible_region(0.9)[HEIGHT] for p in posteriors]),
            floors=np.array([self.reach.at(height).floor for height in heights]),
            unusable=data.left_out,
        )


def height_prior(heights: tuple[float, float]) -> Prior:
    """Returns the uniform prior of the height between two [m]."""
    low, high = heights
    return Prior([Parameter(path=HEIGHT, distribution="uniform", low=low, high=high)])


def observing_radii(scene: Scene) -> Scene:
    """Returns the scene with an `observe.radius` of the two percentiles.

    Raises:
        ValueError: the scene observes something else, or has no funnel.
    """
    scene.get(HEIGHT)
    if scene.observed_names == STATISTICS:
        return scene
    if "observe" in scene.to_dict():
        raise ValueError(
            f"a scene for rings observes {', '.join(STATISTICS)} or nothing; {scene.name!r} "
            f"observes {', '.join(scene.observed_names) or 'something without statistics'}"
        )
    percentiles = ", ".join(str(p) for p in PERCENTILES)
    table = f"\n[observe]\nrate = 10.0\n\n[observe.radius]\npercentiles = [{percentiles}]\n"
    return Scene.from_toml(scene.to_toml() + table)


def _is_trained(folder: Path, data: Dataset) -> bool:
    """Whether the folder holds a model of just these pours."""
    path = folder / _TRAINING
    if not path.exists():
        return False
    kept = Dataset.load(path)
    # Heights are drawn alike whatever the scene is.
    return kept.scene_toml == data.scene_toml and all(
        np.array_equal(one, other, equal_nan=True)
        for one, other in ((kept.theta, data.theta), (kept.x, data.x))
    )
