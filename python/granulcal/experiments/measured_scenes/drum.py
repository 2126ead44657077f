"""The rotating drum at 15 and 45 rounds a minute: friction by a prior over the scene."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from granulcal.errors import NotOfPriorWarning
from granulcal.measured.recording import Recording
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.forward import scene_at
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import simulate
from granulcal.prior import Prior

__all__ = ["Drum", "drums", "reproduce", "training"]

_HERE = Path(__file__).parent
_FOLDER = Path("granudrum-mcc")
_WIDTH = 0.084
_ROWS = 56
_SEED = 1
_FORWARD_SEEDS = (9000, 9001, 9002)
# Rounds a minute, when the mean begins and when the pour ends [s].
_SPEEDS = ((15, 1.0, 1.5), (45, 0.8, 1.2))
# The authors' fit in their own simulator: sliding and rolling friction, restitution 0.3.
_AUTHORS = {"material.sliding_friction": 0.561, "material.rolling_friction": 0.293}


@dataclass(frozen=True, kw_only=True, eq=False)
class Drum:
    """One speed.

    Attributes:
        rpm: rounds a minute.
        scene: the scene.
        measured: the statistics of the picture, shape (k,).
    """

    rpm: int
    scene: Scene
    measured: NDArray[np.float64]


def drums(data_dir: Path) -> list[Drum]:
    """Returns both speeds with their measured statistics."""
    base = Scene.load(_HERE / "drum.toml")
    found = []
    for rpm, begin, end in _SPEEDS:
        rate = rpm * 2.0 * np.pi / 60.0
        changes = {f"walls.{i}.motion.rate": rate for i in (0, 1)}
        scene = base.with_(
            {**changes, "observe.begin": begin, "end.horizon": end, "name": f"drum{rpm}"}
        )
        picture = data_dir / _FOLDER / f"gd_nature_{rpm}rpm_averaged.bmp"
        measured = np.asarray(Recording.observed(picture, scene, width=_WIDTH))
        found.append(Drum(rpm=rpm, scene=scene, measured=measured))
    return found


def training(out_dir: Path, found: list[Drum]) -> list[Dataset]:
    """Returns the rows of both speeds, of the same parameters row by row; resumable."""
    prior = Prior.load(_HERE / "drum_prior.toml")
    return [
        generate(drum.scene, prior, _ROWS, seed=_SEED, out=out_dir / f"drum{drum.rpm}")
        for drum in found
    ]


def rms_mm(values: NDArray[np.float64], measured: NDArray[np.float64]) -> float:
    """Returns the root mean square difference of two profiles [mm]; the slope comes last."""
    return 1e3 * float(np.sqrt(np.mean((values[:-1] - measured[:-1]) ** 2)))


def reproduce(out_dir: Path, data_dir: Path) -> str:
    """Infers the friction from both speeds at once and compares profiles; returns Markdown."""
    from granulcal.bayessim import BayesSim

    found = drums(data_dir)
    sets = training(out_dir, found)
    usable = np.logical_and.reduce([data.is_usable for data in sets])
    x = np.hstack([data.x for data in sets])[usable]
    names = [f"{n} at {d.rpm} rpm" for d in found for n in d.scene.observed_names]
    prior = sets[0].prior
    with warnings.catch_warnings():
        # Pours that cannot be used have been left out, and their materials are not any.
        warnings.simplefilter("ignore", NotOfPriorWarning)
        model = BayesSim.fit(sets[0].theta[usable], x, prior=prior, x_names=names, seed=_SEED)
    observed = np.hstack([drum.measured for drum in found])
    misfit = model.misfit(observed)
    posterior = model.posterior(observed)
    mode = posterior.mode()
    lines = ["## Drum", "", f"Misfit of both speeds at once: {misfit}", ""]
    region = posterior.credible_region(0.9)
    lines += ["| parameter | mode | 90 % region |", "|---|---|---|"]
    for name, value in zip(posterior.names, mode, strict=True):
        low, high = region[name]
        lines.append(f"| {name} | {value:.3g} | {low:.3g} to {high:.3g} |")
    lines += [
        "",
        "| rpm | measured slope [deg] | posterior mode: slope, rms [mm] "
        "| authors' coefficients: slope, rms [mm] | best row of training: rms [mm] |",
        "|---|---|---|---|---|",
    ]
    profiles = []
    for drum, data in zip(found, sets, strict=True):
        at_mode = _mean(scene_at(drum.scene, prior, mode))
        at_authors = _mean(drum.scene.with_(_AUTHORS))
        best = min(rms_mm(row, drum.measured) for row in data.x[usable])
        lines.append(
            f"| {drum.rpm} | {drum.measured[-1]:.1f} "
            f"| {at_mode[-1]:.1f}, {rms_mm(at_mode, drum.measured):.2f} "
            f"| {at_authors[-1]:.1f}, {rms_mm(at_authors, drum.measured):.2f} | {best:.2f} |"
        )
        profiles.append((drum, at_mode, at_authors))
    _picture(out_dir / "measured-drum.png", profiles)
    return "\n".join(lines)


def _mean(scene: Scene) -> NDArray[np.float64]:
    """Returns the observed statistics, mean over the forward seeds."""
    return np.mean([simulate(scene, seed=seed).observed() for seed in _FORWARD_SEEDS], axis=0)


def _picture(
    path: Path, profiles: list[tuple[Drum, NDArray[np.float64], NDArray[np.float64]]]
) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(profiles), figsize=(9, 4), sharey=True, layout="constrained")
    for axis, (drum, at_mode, at_authors) in zip(axes, profiles, strict=True):
        x = [1e3 * drum.scene.get(f"observe.surface.x.{i}") for i in range(len(at_mode) - 1)]
        axis.plot(x, 1e3 * drum.measured[:-1], "k.-", label="measured")
        axis.plot(x, 1e3 * at_mode[:-1], "-", label="posterior mode")
        axis.plot(x, 1e3 * at_authors[:-1], "--", label="authors' coefficients")
        axis.set(title=f"{drum.rpm} rpm", xlabel="x [mm]", aspect="equal")
    axes[0].set_ylabel("height of the free surface [mm]")
    axes[0].legend()
    figure.savefig(path, dpi=80)
    plt.close(figure)
