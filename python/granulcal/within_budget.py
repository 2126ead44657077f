"""A material from recordings with a given number of pours, made for these recordings alone."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import DoubtfulRecordingWarning, PriorError, TrainingDataError
from granulcal.files import DATA_SET
from granulcal.measured.different import require_different
from granulcal.measured.plausible import doubts_of_frames
from granulcal.measured.recording import Recording
from granulcal.pours.cluster import Cluster, cluster_asked, spread_over
from granulcal.pours.kept_pours import KeptPours
from granulcal.pours.made_for import MadeFor
from granulcal.pours.scene import Scene, require_scene
from granulcal.pours.statistics import NAMES
from granulcal.prior import Prior, require_prior

if TYPE_CHECKING:
    from granulcal.bayessim.training.sequential import Round, SequentialFit
    from granulcal.engines import Engine

__all__ = ["KeptPours", "calibrate_observed", "calibrate_within"]

Array = NDArray[np.float64]


def calibrate_within(
    scene: Scene,
    prior: Prior,
    recordings: Sequence[Recording],
    *,
    budget: int = 100,
    out: str | PathLike[str],
    seed: int = 0,
    threads: int | None = None,
    progress: "Callable[[Round], None] | None" = None,
    poured: Callable[[int], None] | None = None,
    engine: "Engine | None" = None,
    ray: "str | Cluster | None" = None,
) -> "SequentialFit":
    """Returns the posterior of recordings of one material from `budget` pours.

    Stop it anywhere: the same call goes on after the last pour that is kept in `out`. The folder is
    of these recordings: with others it is refused.

    Args:
        scene: what was poured, with the camera that looked.
        prior: of the parameters.
        recordings: one or several of one material.
        budget: pours in all, at least 60.
        out: folder of pours.json.
        seed: seed of every random choice.
        threads: pours at once; the default is one for each core.
        progress: called after each round.
        poured: called with the number of kept pours after each.
        engine: another simulator in place of ours; docs/engines.md says what it must do.
        ray: address of a Ray cluster that makes the pours, as `ray.init` takes it, or `local`;
            None for this machine's threads.

    Raises:
        PriorError: a parameter that has no place in the scene over its whole range.
        TrainingDataError: too few pours of the first round can be used; says why.
        TypeError: something that is no scene, no prior or no recording.
        ValueError: no recording, one that is given twice, too small a budget, or a folder of pours
            that were made for other recordings.

    Warns:
        DoubtfulRecordingWarning: what `Recording.doubts` says, recordings that are frames of one
            pour, or grains let go above the camera.
    """
    from granulcal.bayessim.training.sequential import round_sizes
    from granulcal.loop.recorded import doubt_of_start

    require_scene(scene)
    require_prior(prior)
    if not recordings:
        raise ValueError("calibrate_within needs at least one recording, got none")
    round_sizes(budget)
    _require_fits(prior, scene)
    _require_recordings(recordings)
    for doubt in doubt_of_start("the scene", scene):
        warnings.warn(doubt, DoubtfulRecordingWarning, stacklevel=2)
    for each in recordings:
        for doubt in each.doubts(scene, prior):
            warnings.warn(f"{each.path}: {doubt}", DoubtfulRecordingWarning, stacklevel=2)
    for doubt in doubts_of_frames(scene, prior, recordings, [each.path for each in recordings]):
        warnings.warn(doubt, DoubtfulRecordingWarning, stacklevel=2)
    formations = [each.formation(**scene.reading) for each in recordings]
    observed = np.array([np.asarray(formation.statistics()) for formation in formations])
    require_different(observed)
    pours = KeptPours(
        scene,
        prior,
        _file_in(out),
        seed=seed,
        threads=threads,
        progress=poured,
        engine=engine,
        made_for=MadeFor.of([each.path for each in recordings], observed),
    )
    return _inferred(pours, pours, NAMES, observed, budget, progress, ray)


def _require_recordings(value: object) -> None:
    """Raises TypeError unless `value` is a list of recordings."""
    if not isinstance(value, Sequence) or isinstance(value, str):
        raise TypeError(f"recordings must be a list of what Recording.open returns, got {value!r}")
    for each in value:
        if not isinstance(each, Recording):
            raise TypeError(
                f"recordings must be a list of what Recording.open returns, got {each!r} in it"
            )


def calibrate_observed(
    scene: Scene,
    prior: Prior,
    measured: Mapping[str, Mapping[str, float]],
    *,
    budget: int = 100,
    out: str | PathLike[str],
    seed: int = 0,
    threads: int | None = None,
    progress: "Callable[[Round], None] | None" = None,
    poured: Callable[[int], None] | None = None,
    engine: "Engine | None" = None,
    ray: "str | Cluster | None" = None,
) -> "SequentialFit":
    """Returns the posterior of what a scene observes, measured once or several times.

    Args:
        scene: what was measured, with its `observe`.
        prior: of the parameters.
        measured: by name of the measurement its statistics, as `Recording.observed` reads them;
            of one material. Those that are NaN in one of them are left out of all.
        budget: as in `calibrate_within`, like the rest.
        out: folder of pours.json.
        seed: seed of every random choice.
        threads: pours at once; the default is one for each core.
        progress: called after each round.
        poured: called with the number of kept pours after each.
        engine: another simulator in place of ours.
        ray: address of a Ray cluster that makes the pours.

    Raises:
        PriorError: a parameter that has no place in the scene over its whole range.
        ValueError: nothing was measured of what the scene observes, too small a budget, or a folder
            of pours that were made for something else.
    """
    from granulcal.bayessim.training.sequential import round_sizes

    round_sizes(budget)
    _require_fits(prior, scene)
    all_names = tuple(scene.observed_names)
    table = np.array([[each[name] for name in all_names] for each in measured.values()], float)
    known = np.atleast_1d(np.isfinite(table.reshape(len(measured), len(all_names))).all(axis=0))
    if not measured or not known.any():
        raise ValueError(
            f"{', '.join(measured) or 'nothing that was measured'} must have a value of one of "
            f"{', '.join(all_names) or 'the statistics that the scene observes'}, got none"
        )
    observed = table[:, known]
    pours = KeptPours(
        scene,
        prior,
        _file_in(out),
        seed=seed,
        threads=threads,
        progress=poured,
        observed=True,
        engine=engine,
        made_for=MadeFor.of(list(measured), observed),
    )
    names = tuple(name for name, has in zip(all_names, known, strict=True) if has)

    def pour(theta: Array, first: int) -> Array:
        return pours(theta, first)[:, known]

    return _inferred(pours, pour, names, observed, budget, progress, ray)


def _file_in(out: str | PathLike[str]) -> Path:
    """The file of kept pours in a folder, which is made; a data set has one of its own."""
    folder = Path(out)
    file = folder / "pours.json"
    if (folder / DATA_SET).is_file() and not file.exists():
        raise ValueError(
            f"{folder} is a data set of `generate`: these pours are made for the recordings alone "
            "and no part of it; give another folder"
        )
    folder.mkdir(parents=True, exist_ok=True)
    return file


def _inferred(
    pours: KeptPours,
    pour: Callable[[Array, int], Array],
    names: tuple[str, ...],
    observed: Array,
    budget: int,
    progress: "Callable[[Round], None] | None",
    ray: "str | Cluster | None",
) -> "SequentialFit":
    """The posterior by what `pour` gives of kept pours, and what pours it is without."""
    from granulcal.bayessim.training.sequential import infer_within_budget

    try:
        with spread_over(cluster_asked(ray)):
            found = infer_within_budget(
                pour,
                pours.prior,
                observed,
                budget=budget,
                seed=pours.seed,
                x_names=names,
                progress=progress,
            )
    except TrainingDataError as error:
        left_out = pours.left_out(budget, names)
        if left_out.total == 0:
            raise
        raise TrainingDataError(f"{error}. Not usable: {left_out}{left_out.advice}") from None
    return replace(found, left_out=pours.left_out(len(found.x), names))


def _require_fits(prior: Prior, scene: Scene) -> None:
    """Refuses before the first pour what `generate` refuses; a later one would draw it.

    Raises:
        PriorError: names the parameter and the value that does not fit.
    """
    for parameter in prior.parameters:
        for value in filter(np.isfinite, parameter.bounds):
            try:
                scene.with_({parameter.path: value})
            except ValueError as error:
                told = f"prior of {parameter.path} does not fit the scene at the value {value:g}"
                raise PriorError(f"{told}: {error}") from None
