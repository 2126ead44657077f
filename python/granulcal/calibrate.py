"""From recordings and a trained model to a posterior, forward pours and a report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from granulcal.measured.different import require_different
from granulcal.measured.formation import Formation
from granulcal.measured.recording import Recording
from granulcal.pours.dataset import Dataset
from granulcal.pours.forward import draws_of, pours_at, scene_at
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour
from granulcal.pours.statistics import NAMES
from granulcal.report import write_report

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim
    from granulcal.bayessim.check.misfit import Misfit
    from granulcal.bayessim.posterior.posterior import Posterior

__all__ = [
    "Calibrated",
    "calibrate",
    "calibrate_measured",
    "require_own_statistics",
    "require_same_scene",
]

# Seeds of forward pours: far from those of data sets, which are hashes, and of demo recordings.
_FIRST_SEED = 9000


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated:
    """What `calibrate` found.

    Attributes:
        posterior: the inferred parameters.
        observed: statistics of each recording, SI units, shape (k, s).
        pours: pours at the posterior's mode.
        prior_pours: pours at the prior's mean.
        report: the HTML page.
        misfit: whether any parameters explain the recordings.
    """

    posterior: "Posterior"
    observed: NDArray[np.float64]
    pours: list[Pour]
    prior_pours: list[Pour]
    report: Path
    misfit: "Misfit"


def require_same_scene(model: "BayesSim", scene: Scene) -> None:
    """Refuses a model that was trained on another scene.

    Raises:
        ValueError: the scenes differ, or the model does not know its scene.
    """
    if model.scene_toml is None:
        raise ValueError("the model does not say which scene it was trained on")
    trained = Scene.from_toml(model.scene_toml)
    if trained != scene:
        raise ValueError(
            f"the model was trained on another scene: {_first_difference(trained, scene)}"
        )


def require_own_statistics(model: "BayesSim") -> None:
    """Refuses a model of other statistics than a recording gives, or of these in another order.

    Raises:
        ValueError: the statistics differ.
    """
    if tuple(model.x_names) != tuple(NAMES):
        raise ValueError(
            f"the model must be of the {len(NAMES)} statistics of an image, in order; it is of "
            f"{', '.join(model.x_names)}: `granulcal infer` takes recordings of some of the "
            f"{len(NAMES)}, and with `report` tables of what a scene observes"
        )


def calibrate(
    model: "BayesSim",
    data: Dataset,
    recordings: Sequence[Recording],
    *,
    report: str | PathLike[str],
    seeds: int = 3,
    draws: int = 0,
    threads: int | None = None,
    truth: ArrayLike | None = None,
    title: str = "Calibration report",
    summary: str = "",
    notes: Sequence[str] = (),
    command: str = "",
    segmentation: Mapping[str, Any] | None = None,
    diagnostics: Sequence[str] = (),
) -> Calibrated:
    """Infers the material of recordings, simulates it and writes the report.

    Args:
        model: trained on `data`.
        data: the pours that the model was trained on.
        recordings: formations of one material in the scene of `data`, at least one; the page shows
            the first and compares the mean of their statistics.
        report: the HTML file.
        seeds: number of pours at the posterior's mode and at the prior's mean.
        draws: pours at draws of the posterior, for the band of the page's profile.
        threads: pours at once; the default is one for each core.
        truth: the true parameters, where they are known, shape (p,).
        title: heading of the page.
        summary: one paragraph that says what was done.
        notes: further sentences that a reader must know.
        command: command line that makes the page again.
        segmentation: options of `Recording.formation` for every recording, over those that make
            them like the scene's images (`Scene.reading`).
        diagnostics: names of the diagnostic statistics that the model was trained on after the 16.

    Raises:
        ValueError: no recording, one that is given twice, another scene, or a pour without grains
            in view.
    """
    if not recordings:
        raise ValueError("calibrate needs at least one recording, got none")
    require_same_scene(model, data.scene)
    options: dict[str, Any] = dict(data.scene.reading)
    options |= segmentation or {}
    formations = [recording.formation(**options) for recording in recordings]
    observed = np.array([np.asarray(formation.statistics()) for formation in formations])
    require_different(observed)
    # A height map does not say where the axis was, about which those of pours are.
    axes = [None if each.depth is None else (0.0, 0.0) for each in recordings]
    known = np.hstack([observed, _diagnostics(formations, axes, data.scene, diagnostics)])
    return _told(
        model,
        data,
        (known, observed),
        report=report,
        seeds=seeds,
        draws=draws,
        threads=threads,
        observed_points=formations[0].points,
        truth=truth,
        title=title,
        summary=summary,
        notes=notes,
        command=command,
    )


def calibrate_measured(
    model: "BayesSim",
    data: Dataset,
    measured: Sequence[Mapping[str, float]],
    *,
    report: str | PathLike[str],
    seeds: int = 3,
    threads: int | None = None,
    title: str = "Calibration report",
    summary: str = "",
    notes: Sequence[str] = (),
    command: str = "",
) -> Calibrated:
    """Infers the material of what a scene observes, simulates it and writes the report.

    As `calibrate`, of drums, run-outs, discharges and the like; the page has no pictures of piles.

    Args:
        model: trained on `data`, of statistics that its scene observes.
        data: the pours that the model was trained on.
        measured: the statistics by name of pours of one material, at least one.
        report: the HTML file.
        seeds: number of pours at the posterior's mode and at the prior's mean.
        threads: pours at once; the default is one for each core.
        title: heading of the page.
        summary: one paragraph that says what was done.
        notes: further sentences that a reader must know.
        command: command line that makes the page again.

    Raises:
        ValueError: nothing measured, another scene, or other statistics.
    """
    if not measured:
        raise ValueError("calibrate_measured needs at least one measurement, got none")
    require_same_scene(model, data.scene)
    if tuple(model.x_names) != tuple(data.x_names):
        raise ValueError(
            f"the pours must have the statistics of the model, {', '.join(model.x_names)}; "
            f"they have {', '.join(data.x_names)}"
        )
    known = np.array([[found[name] for name in model.x_names] for found in measured])
    return _told(
        model,
        data,
        (known, known),
        report=report,
        seeds=seeds,
        draws=0,
        threads=threads,
        observed_points=None,
        title=title,
        summary=summary,
        notes=notes,
        command=command,
    )


def _told(
    model: "BayesSim",
    data: Dataset,
    statistics: tuple[NDArray[np.float64], NDArray[np.float64]],
    *,
    report: str | PathLike[str],
    seeds: int,
    draws: int,
    threads: int | None,
    **told: Any,
) -> Calibrated:
    """Infers, pours and writes the page, given what the model and what the page asks for."""
    known, observed = statistics
    posterior = model.posterior(known)
    misfit = model.misfit(known)
    numbers = range(_FIRST_SEED, _FIRST_SEED + seeds)
    fitted = scene_at(data.scene, model.prior, posterior.mode())
    unfitted = scene_at(data.scene, model.prior, model.prior.mean())
    pours = pours_at(fitted, numbers, threads=threads)
    prior_pours = pours_at(unfitted, numbers, threads=threads)
    page = write_report(
        report,
        observed=observed.mean(axis=0),
        observed_count=len(observed),
        posterior=posterior,
        pours=pours,
        prior_pours=prior_pours,
        drawn=draws_of(data.scene, posterior, draws, threads=threads),
        data=data,
        calibration=model.calibration,
        misfit=misfit,
        **told,
    )
    return Calibrated(
        posterior=posterior,
        observed=observed,
        pours=pours,
        prior_pours=prior_pours,
        report=page,
        misfit=misfit,
    )


def _diagnostics(
    formations: Sequence[Formation],
    axes: Sequence[tuple[float, float] | None],
    scene: Scene,
    names: Sequence[str],
) -> NDArray[np.float64]:
    """Returns these diagnostic statistics of each formation about its axis, (k, len(names))."""
    if not names:
        return np.empty((len(formations), 0))
    diameter = scene.get("grains.diameter")
    found = [
        each.diagnostic_statistics(grain_diameter=diameter, pour_axis=axis)
        for each, axis in zip(formations, axes, strict=True)
    ]
    return np.array([[row[name] for name in names] for row in found])


def _first_difference(trained: Scene, asked: Scene) -> str:
    """Names the first line of TOML in which two scenes differ."""
    left, right = trained.to_toml().splitlines(), asked.to_toml().splitlines()
    for ours, theirs in zip(left, right, strict=False):
        if ours != theirs:
            return f"{ours!r} there, {theirs!r} asked for"
    return f"{len(left)} lines there, {len(right)} asked for"
