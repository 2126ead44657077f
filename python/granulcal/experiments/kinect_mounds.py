"""Mounds of sand on a hard bed under an overhead Kinect: the whole line on measured height maps.

The maps are the `compacted_*` files of the folder `granular-impact-kinect` (Viera-Lopez et al.,
MIT). The sand is finer than 1 mm, so 2000 grains of 4 mm stand for the same volume; the height from
which the ball of sand was let go, the width of the camera's point spread, what holds clods together
and how a bed of sand stops grains are unknown and inferred with the material, from the 16
statistics and the three of `SHAPE`.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from granulcal.calibrate import Calibrated, calibrate
from granulcal.cores import cores
from granulcal.files import write_beside
from granulcal.measured.recording import Recording
from granulcal.pours.compare import Scale, nearest_row, standardised_distance
from granulcal.pours.dataset import Dataset, generate
from granulcal.pours.forward import pours_at, scene_at
from granulcal.pours.pour_time import PourKind, in_the_middle, pour_time
from granulcal.pours.scene import Scene
from granulcal.pours.simulate import Pour
from granulcal.pours.statistics import diagnostic_statistics
from granulcal.prior import Prior
from granulcal.progress import duration

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim

__all__ = [
    "FOLDER",
    "READING",
    "SHAPE",
    "MapResult",
    "demo",
    "maps_in",
    "measured_maps",
    "picture",
    "reproduce",
    "shape_of_map",
    "shape_of_pour",
    "study_prior",
    "study_scene",
]

SHAPE = ("patches", "roughness", "shoulder")
"""Statistics that see clods, terraces and a steep edge."""

FOLDER = Path("granular-impact-kinect") / "data"
"""Of the maps, within the measured data."""
_HERE = Path(__file__).parent
_POURS = 800
_DEMO_POURS = 120
_DEMO_MAP = "compacted_8"
_SEED = 1
_FORWARD_SEEDS = 3
READING = {"border_px": 6, "height_threshold": 1e-3}
"""How a map is read: Kinect maps have dead pixels along their edges."""
# A second set of forward pours, at the posterior's mean, has seeds of its own.
_MEAN_SEEDS = range(9100, 9100 + _FORWARD_SEEDS)

_SUMMARY = (
    "A ball of sand fell on a hard bed; an overhead Kinect measured the height map. 2000 grains of "
    "4 mm stand for the same volume of finer sand. Drop height and the camera's blur are unknown "
    "and inferred with the material."
)
_NOTES = (
    "The stand-in grains are spheres of one size on a bed of their own material; real sand is "
    "finer, angular and fell on sand. Parameters are those of the stand-in, not of the sand.",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class MapResult:
    """What one map gave; distances are L2 norms over the 16 statistics in training sds.

    Attributes:
        name: name of the map.
        mode: posterior mode, own units, shape (p,).
        interval: 90 % interval of each parameter, shape (p, 2).
        prior_distance: mean over pours at the prior's mean.
        training_distance: the nearest pour of the training set.
        mode_distance: mean over pours at the posterior's mode.
        mean_distance: mean over pours at the posterior's mean.
        floor_distance: mean between two pours at the posterior's mode: what no parameters undercut.
        warnings: what the posterior warned of.
        is_inside: whether any parameters explain the 16 statistics (`BayesSim.misfit`).
        measured: `patches`, `roughness` [m] and `shoulder` of the map.
        simulated: the same of each pour at the posterior's mode, shape (k, 3).
    """

    name: str
    mode: NDArray[np.float64]
    interval: NDArray[np.float64]
    prior_distance: float
    training_distance: float
    mode_distance: float
    mean_distance: float
    floor_distance: float
    warnings: tuple[str, ...]
    is_inside: bool
    measured: NDArray[np.float64]
    simulated: NDArray[np.float64]

    def to_dict(self, names: Sequence[str]) -> dict[str, Any]:
        """Returns it for JSON; `names` are those of the parameters."""
        shape = {
            name: {"measured": float(seen), "simulated": made.tolist()}
            for name, seen, made in zip(SHAPE, self.measured, self.simulated.T, strict=True)
        }
        return {
            "map": self.name,
            "L2": {
                "posterior_mode": self.mode_distance,
                "posterior_mean": self.mean_distance,
                "best_of_training": self.training_distance,
                "prior_mean": self.prior_distance,
                "floor": self.floor_distance,
            },
            **shape,
            "is_inside": self.is_inside,
            "mode": dict(zip(names, self.mode.tolist(), strict=True)),
            "interval_90": dict(zip(names, self.interval.tolist(), strict=True)),
            "warnings": list(self.warnings),
        }


def measured_maps(data_dir: Path) -> list[Path]:
    """Returns the mound maps of the study in the order of their numbers.

    Raises:
        FileNotFoundError: there is none.
    """
    return maps_in(data_dir / FOLDER)


def maps_in(folder: Path) -> list[Path]:
    """Returns the mound maps of a folder, `compacted_*.npz`, in the order of their numbers.

    Raises:
        FileNotFoundError: there is none.
    """
    maps = folder.glob("compacted_*.npz")
    ordered = sorted(maps, key=lambda path: int(path.stem.rpartition("_")[2]))
    if not ordered:
        raise FileNotFoundError(f"no compacted_*.npz in {folder}")
    return ordered


def reproduce(
    out_dir: Path,
    data_dir: Path | None,
    *,
    maps_dir: Path | None = None,
    json_path: Path | None = None,
) -> list[MapResult]:
    """Runs the line on every mound map and writes reports, a table and a picture to `out_dir`.

    Args:
        out_dir: folder of pours, model, reports, table and picture.
        data_dir: the measured data; not needed with `maps_dir`.
        maps_dir: folder of other maps `compacted_*.npz`, in place of those of `data_dir`.
        json_path: file for what each map gave: distances, shape measured and simulated, inside or
            outside of the model.

    Raises:
        FileNotFoundError: there is no map.
    """
    folder = maps_dir if data_dir is None or maps_dir is not None else data_dir / FOLDER
    if folder is None:
        raise FileNotFoundError("neither a folder of maps nor the measured data were given")
    maps = maps_in(folder)
    data = _training_pours(out_dir, _POURS)
    model = _trained(data)
    model.save(out_dir / "model")
    results, clouds = [], []
    for path in maps:
        recording = Recording.open(path)
        calibrated = _calibrate_map(model, data, recording, out_dir / f"{path.stem}.html")
        results.append(_judge(path.stem, recording, calibrated, model, data))
        clouds.append((recording.formation(**READING).points, calibrated.pours[0].points()))
        print(_row(results[-1]), flush=True)
    write_beside(out_dir / "results.md", _table(results, model.prior.names))
    picture(out_dir / "formations.png", [path.stem for path in maps], clouds)
    print(f"table and picture in {out_dir}")
    if json_path is not None:
        rows = [result.to_dict(model.prior.names) for result in results]
        write_beside(json_path, json.dumps({"maps": rows}, indent=1) + "\n")
        print(json_path)
    return results


def poured(data: Path | None) -> list[PourKind]:
    """Returns what is poured, for `--dry-run`."""
    return [PourKind("the training set", study_scene(), study_prior(), _POURS)]


def demo(out_dir: Path, data_dir: Path) -> Calibrated:
    """Runs the line on one map with few pours; the report is `out_dir/report.html`."""
    data = _training_pours(out_dir, _DEMO_POURS)
    model = _trained(data)
    path = data_dir / FOLDER / f"{_DEMO_MAP}.npz"
    calibrated = _calibrate_map(model, data, Recording.open(path), out_dir / "report.html")
    print(_row(_judge(path.stem, Recording.open(path), calibrated, model, data)))
    print(f"    report: {calibrated.report}")
    return calibrated


def study_scene() -> Scene:
    """Returns the ball of sand above a hard bed."""
    return Scene.load(_HERE / "kinect_mounds.toml")


def study_prior() -> Prior:
    """Returns what is unknown of it."""
    return Prior.load(_HERE / "kinect_mounds_prior.toml")


def _training_pours(out_dir: Path, count: int) -> Dataset:
    scene, prior = study_scene(), study_prior()
    each, threads = pour_time([in_the_middle(scene, prior)]).seconds, cores()
    print(
        f"{count} pours less those that are there: at {each:.1f} s each, {threads} at once, about "
        f"{duration(count * each / threads)} for all; then {3 * _FORWARD_SEEDS} for each map",
        flush=True,
    )
    return generate(scene, prior, count, seed=_SEED, out=out_dir / "pours")


def _trained(data: Dataset) -> "BayesSim":
    """Returns the model of the 16 statistics and of those that see clods."""
    from granulcal.bayessim import BayesSim

    columns = [data.diagnostic_names.index(name) for name in SHAPE]
    return BayesSim.fit(
        data.theta,
        np.hstack([data.x, data.diagnostics[:, columns]]),
        data.prior,
        _SEED,
        status=data.status.tolist(),
        x_names=(*data.x_names, *SHAPE),
        scene=data.scene_toml,
    )


def _calibrate_map(
    model: "BayesSim", data: Dataset, recording: Recording, report: Path
) -> Calibrated:
    return calibrate(
        model,
        data,
        [recording],
        report=report,
        seeds=_FORWARD_SEEDS,
        title=f"Sand mound {recording.path.stem}",
        summary=_SUMMARY,
        notes=_NOTES,
        command="granulcal reproduce kinect_mounds",
        segmentation=READING,
        diagnostics=SHAPE,
    )


def _judge(
    name: str, recording: Recording, calibrated: Calibrated, model: "BayesSim", data: Dataset
) -> MapResult:
    prior = model.prior
    observed = calibrated.observed[0]
    scale = Scale.of(data)

    def distance(pours: Sequence) -> float:
        each = [standardised_distance(pour.statistics(), observed, scale) for pour in pours]
        return float(np.mean(each))

    pairs = combinations([pour.statistics() for pour in calibrated.pours], 2)
    between = [standardised_distance(one, other, scale) for one, other in pairs]

    posterior = calibrated.posterior
    region = posterior.credible_region(0.9)
    at_mean = pours_at(scene_at(data.scene, prior, posterior.mean()), _MEAN_SEEDS)
    return MapResult(
        name=name,
        mode=posterior.mode(),
        interval=np.array([region[parameter] for parameter in posterior.names]),
        prior_distance=distance(calibrated.prior_pours),
        training_distance=standardised_distance(
            data.x[nearest_row(observed, data)], observed, scale
        ),
        mode_distance=distance(calibrated.pours),
        mean_distance=distance(at_mean),
        floor_distance=float(np.mean(between)),
        warnings=tuple(str(warning) for warning in posterior.warnings),
        is_inside=calibrated.misfit.is_inside,
        measured=shape_of_map(recording, data.scene),
        simulated=np.array([shape_of_pour(pour) for pour in calibrated.pours]),
    )


def shape_of_map(recording: Recording, scene: Scene) -> NDArray[np.float64]:
    """Returns `SHAPE` of a measured map, its pixels as wide as those of the scene's images."""
    settings = {**READING, "ground_resolution": scene.ground_resolution}
    found = recording.formation(**settings).diagnostic_statistics(
        grain_diameter=scene.get("grains.diameter")
    )
    return np.array([found[name] for name in SHAPE])


def shape_of_pour(pour: Pour) -> NDArray[np.float64]:
    """Returns `SHAPE` of a pour about the centroid of its points, as maps are read."""
    points = pour.points()
    centred = points - np.array([*points[:, :2].mean(axis=0), 0.0])
    found = diagnostic_statistics(
        centred,
        grain_diameter=2 * float(pour.radii.mean()),
        spacing=pour.scene.ground_resolution,
        pour_axis=None,
    )
    return np.array([found[name] for name in SHAPE])


def _row(result: MapResult) -> str:
    return (
        f"    {result.name:<14} L2: prior mean {result.prior_distance:.2f}, best of training "
        f"{result.training_distance:.2f}, posterior mode {result.mode_distance:.2f}, "
        f"posterior mean {result.mean_distance:.2f}, floor {result.floor_distance:.2f}"
    )


def _short(names: Sequence[str]) -> list[str]:
    """Returns the last word of each path; of those that share it all but the first has two."""
    last = [name.rpartition(".")[2] for name in names]
    return [
        word if word not in last[:i] else ".".join(names[i].split(".")[-2:])
        for i, word in enumerate(last)
    ]


def _table(results: list[MapResult], names: Sequence[str]) -> str:
    short = _short(names)
    lines = [
        "| map | prior mean | best of training | posterior mode | posterior mean | floor | "
        + " | ".join(f"{name}: mode (90 % interval)" for name in short)
        + " | warnings |",
        "|---" * (7 + len(short)) + "|",
    ]
    for r in results:
        cells = [
            f"{mode:.3g} ({low:.2g} to {high:.2g})"
            for mode, (low, high) in zip(r.mode, r.interval, strict=True)
        ]
        distances = (
            r.prior_distance, r.training_distance, r.mode_distance, r.mean_distance,
            r.floor_distance,
        )  # fmt: skip
        numbers = " | ".join(f"{distance:.2f}" for distance in distances)
        lines.append(f"| {r.name} | {numbers} | {' | '.join(cells)} | {len(r.warnings)} |")
    columns = {
        "prior mean": [r.prior_distance for r in results],
        "best of training": [r.training_distance for r in results],
        "posterior mode": [r.mode_distance for r in results],
        "posterior mean": [r.mean_distance for r in results],
        "floor": [r.floor_distance for r in results],
    }
    lines.append("")
    for label, values in columns.items():
        low, middle, high = np.quantile(values, [0, 0.5, 1])
        mean = np.mean(values)
        lines.append(f"- {label}: mean {mean:.2f}, median {middle:.2f}, {low:.2f} to {high:.2f}")
    return "\n".join(lines) + "\n"


def picture(path: Path, names: Sequence[str], clouds: Sequence) -> None:
    """Draws every map above a pour that stands for it, one scale for all."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from granulcal.pours.formation_image import height_grid

    field, pixels, columns = 0.36, 130, 8
    rows = 2 * -(-len(names) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(1.5 * columns, 1.6 * rows), squeeze=False)
    image = None
    for axis in axes.flat:
        axis.set_axis_off()
    for index, (name, (measured, simulated)) in enumerate(zip(names, clouds, strict=True)):
        block, column = divmod(index, columns)
        for line, (points, label) in enumerate([(measured, name), (simulated, "simulated")]):
            axis = axes[2 * block + line, column]
            grid = 1e3 * height_grid(points, field=field, pixels=pixels)
            image = axis.imshow(grid, origin="lower", vmin=0, vmax=14, cmap="viridis")
            axis.set_title(label, fontsize=7)
    assert image is not None
    figure.colorbar(image, ax=axes, label="height above the bed [mm]", shrink=0.6)
    figure.savefig(path, dpi=70)
    plt.close(figure)
