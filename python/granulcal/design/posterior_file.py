"""Materials from a Posterior, or from the JSON that `infer -o` and `granulcal calibrate` write."""

import warnings
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.storage.place import MODEL_JSON
from granulcal.documents import Flag, ListOf, Mapping, Maybe, Number, Table, Text, read_json
from granulcal.pours.scene import Scene

if TYPE_CHECKING:
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = ["POSTERIOR_JSON", "OutsideModelWarning", "PosteriorDraws", "UncheckedModelWarning"]

POSTERIOR_JSON = "posterior.json"
"""What `calibrate` writes into its folder."""

Array = NDArray[np.float64]

_SCHEMA = Table(
    {
        "parameters": Maybe(Mapping(Table({"mode": Number()}, open=True))),
        "samples": ListOf(ListOf(Number())),
    },
    optional={
        "inside_model": Table({"is_inside": Flag()}, open=True),
        "fixed": Mapping(Number()),
        "engine": Maybe(Text()),
        "calibrated": Flag(),
        "warnings": ListOf(Text()),
    },
    open=True,
)
# As many as `granulcal infer -o` writes.
_SAMPLES = 1000


class OutsideModelWarning(UserWarning):
    """A posterior is that of recordings that no parameters of its model explain."""


class UncheckedModelWarning(UserWarning):
    """A posterior is by a model that has not passed a check of its own."""


@dataclass(frozen=True)
class PosteriorDraws:
    """Draws of a posterior.

    Attributes:
        names: paths of the parameters.
        samples: own units, shape (n, p).
        mode: most probable parameters, own units, shape (p,).
        is_inside: whether the model explains the recordings; if not these are its best compromise.
        fixed: values of the parameters that the prior fixed, by path.
        engine: the `--engine` whose pours it was learnt from; None of our own, or not told.
    """

    names: tuple[str, ...]
    samples: Array
    mode: Array
    is_inside: bool = True
    fixed: dict[str, float] = field(default_factory=dict)
    engine: str | None = None

    @classmethod
    def load(cls, path: str | PathLike[str]) -> "PosteriorDraws":
        """Returns the draws of a file; warns of those of recordings that no parameters explain.

        Those by a model that has not passed a check of its own are warned of, too, each with what
        the file says of them.

        Args:
            path: JSON of `granulcal infer -o`, or that or the folder of `granulcal calibrate`.

        Raises:
            FileNotFoundError: there is no such file, or a folder has no posterior.
            ValueError: it is not a posterior of `granulcal infer -o` or `granulcal calibrate`.
        """
        path = _file_at(Path(path))
        document = read_json(path, _SCHEMA)
        parameters: dict[str, dict[str, float]] = document["parameters"] or {}
        names = tuple(parameters)
        if not names:
            raise ValueError(f"{path} holds no posterior: the recording was outside the model")
        if any(len(row) != len(names) for row in document["samples"]):
            raise ValueError(f"{path}: each of the samples must have {len(names)} numbers")
        samples = np.array(document["samples"], dtype=float)
        mode = np.array([parameters[name]["mode"] for name in names], dtype=float)
        if samples.ndim != 2 or samples.shape[1] != len(names) or len(samples) == 0:
            raise ValueError(
                f"{path} must have samples of shape (n, {len(names)}), got {samples.shape}"
            )
        is_inside = bool(document.get("inside_model", {}).get("is_inside", True))
        if not is_inside:
            warnings.warn(
                f"{path}: OUTSIDE THE MODEL: no parameters explain the recordings; these are the "
                "model's best compromise, and their intervals mean nothing",
                OutsideModelWarning,
                stacklevel=2,
            )
        if not document.get("calibrated", True):
            told = "".join(f"; {each}" for each in document.get("warnings", []))
            warnings.warn(
                f"{path}: its model has not passed a check of its own (`granulcal check`): its "
                f"intervals may be too narrow{told}",
                UncheckedModelWarning,
                stacklevel=2,
            )
        fixed, engine = document.get("fixed", {}), document.get("engine")
        return cls(names, samples, mode, is_inside, fixed, engine)

    @classmethod
    def of(cls, posterior: "Posterior | PosteriorDraws") -> "PosteriorDraws":
        """Returns the draws of a posterior; draws are their own.

        Raises:
            TypeError: neither.
        """
        from granulcal.bayessim.posterior.posterior import Posterior

        if isinstance(posterior, PosteriorDraws):
            return posterior
        if not isinstance(posterior, Posterior):
            raise TypeError(
                f"posterior must be a Posterior or PosteriorDraws, got {type(posterior).__name__}: "
                "PosteriorDraws.load reads the one in a file"
            )
        names, fixed = tuple(posterior.names), posterior.prior.fixed
        return cls(names, posterior.sample(_SAMPLES), posterior.mode(), fixed=fixed)

    def without(self, name: str) -> "PosteriorDraws":
        """Returns the draws of all other parameters, fixed ones too."""
        kept = [i for i, each in enumerate(self.names) if each != name]
        names = tuple(self.names[i] for i in kept)
        fixed = {path: value for path, value in self.fixed.items() if path != name}
        samples, mode = self.samples[:, kept], self.mode[kept]
        return replace(self, names=names, samples=samples, mode=mode, fixed=fixed)

    def on(self, scene: Scene) -> Scene:
        """Returns the scene with what the prior fixed: what the draws are of."""
        return scene.with_(self.fixed)

    def at_mode(self, scene: Scene) -> Scene:
        """Returns the scene with the most probable parameters and those that the prior fixed."""
        mode = dict(zip(self.names, self.mode.tolist(), strict=True))
        return self.on(scene).with_(mode)


def _file_at(path: Path) -> Path:
    """Returns the file of a posterior that is named by itself or by its folder.

    Raises:
        FileNotFoundError: a folder without one; says what makes it.
    """
    if not path.is_dir():
        return path
    file = path / POSTERIOR_JSON
    if not file.exists():
        made = f"; `granulcal infer {path} RECORDING -o {POSTERIOR_JSON}` makes one of this model"
        raise FileNotFoundError(
            f"{path} holds no {POSTERIOR_JSON}; asked for is JSON of `infer -o`, or that or the "
            f"folder of `calibrate`{made if (path / MODEL_JSON).is_file() else ''}"
        )
    return file
