"""Experiment 7: calibrate at 12 cm, predict 2, 4, 6, 8 and 10 cm.

The recordings are pours of another engine, LAMMPS, in place of the camera: grains like couscous
(spheres of several sizes) and like barley (rigid pairs of spheres), whose model here is equal round
grains. `benches/paper/recordings.py` makes them, also those of 200 grains for the small version.
Each is seen by the scene's camera with the noise of the measured D435, ten frames averaged, as the
paper averages its own.

Two calibrations: the paper's recipe (one estimate a recording, the five of the least error
averaged), and the posterior of all recordings together.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.arrays import read_arrays
from granulcal.experiments.paper.common import three
from granulcal.experiments.paper.common.draw import formations
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.eye import Disturbance, Eye
from granulcal.experiments.paper.common.measure import (
    Published,
    bootstrap_grid,
    bootstrap_pairs,
    level_row,
)
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Row, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Workshop
from granulcal.pours.forward import scene_at
from granulcal.pours.scene import Scene
from granulcal.pours.statistics import statistics

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim

__all__ = ["EXPERIMENT", "SHIPPED", "Recordings"]

Array = NDArray[np.float64]

_PAPER = {
    "couscous": Published(mean=2.2263, sd=0.1377, count=5),
    "barley": Published(mean=2.0311, sd=0.3807, count=5),
}
_CALIBRATED_AT = 0.12
_HEIGHTS = (0.02, 0.04, 0.06, 0.08, 0.10)
SHIPPED = Path(__file__).parent / "recordings"
"""Recordings of the small version."""
_SHIPPED_GRAINS = 120
_MAKER = "python benches/paper/recordings.py"
_FRAMES = 10
_KEPT = 5
_FORWARD = 5
_SEED = 701
_RECIPES = ("the paper's recipe", "all recordings together")
_NONE_USABLE = (
    "None usable: every recording or every pour of that height is left out. From 2 cm a heap of "
    "2000 grains reaches the tip and holds the funnel closed."
)


@dataclass(frozen=True, eq=False)
class Recordings:
    """Piles of another engine.

    Attributes:
        name: of the grain.
        heights: of the funnel's tip [m], shape (m,).
        positions: centres of the spheres [m], NaN for those that left, shape (m, n, 3).
        radii: theirs [m], shape (m, n).
        held: spheres that stayed in the funnel, shape (m,).
    """

    name: str
    heights: Array
    positions: Array
    radii: Array
    held: Array

    @classmethod
    def load(cls, name: str, size: Size, folder: Path) -> "Recordings":
        """Returns the recordings of a grain: the package's for a small version, else of `folder`.

        Raises:
            FileNotFoundError: they have not been made; the message says how.
            ValueError: the file is damaged, or holds something else.
        """
        is_small = size.grains <= _SHIPPED_GRAINS
        path = (SHIPPED if is_small else folder / "recordings") / f"{name}.npz"
        if not path.exists():
            maker = f"{_MAKER} {path.parent}" + ("" if size.is_full else f" --grains {size.grains}")
            raise FileNotFoundError(
                f"no recordings {path}: make them with `{maker}` in an environment "
                "that has LAMMPS (benches/paper/README.md)"
            )
        file = read_arrays(path, "heights", "positions", "radii", "held")
        try:
            found, heights = file["positions"].astype(float), file["heights"].astype(float)
            held, radii = file["held"].astype(float), 1e-5 * file["radii"].astype(float)
            if found.ndim != 3 or found.shape[2] != 3:
                raise ValueError(f"positions must have the shape (m, n, 3), got {found.shape}")
            if heights.shape != found.shape[:1] or held.shape != heights.shape:
                shapes = f"{heights.shape} and {held.shape}"
                raise ValueError(f"heights and held must have the shape (m,), got {shapes}")
            radii = np.broadcast_to(radii, found.shape[:2])
        except (TypeError, ValueError) as error:
            raise ValueError(f"{path}: no recordings of grains: {error}") from None
        # Whole hundredths of a millimetre, to be small; -1 in z is a sphere that left.
        found[found[:, :, 2] < 0] = np.nan
        return cls(name, heights, 1e-5 * found, radii, held)

    def at(self, height: float, count: int) -> NDArray[np.intp]:
        """Returns the rows of the first recordings from `height` that emptied the funnel."""
        rows = np.flatnonzero(np.isclose(self.heights, height) & (self.held == 0))
        return rows[:count]

    def statistics(self, row: int, eye: Eye, threshold: float) -> Array:
        """Returns the 16 statistics of a recording, the mean of ten noisy frames."""
        points = self.points(row, eye, threshold)
        return np.asarray(statistics(points))

    def points(self, row: int, eye: Eye, threshold: float) -> Array:
        """Returns the points of the averaged image that are grain [m], shape (n, 3)."""
        kept = np.isfinite(self.positions[row, :, 2])
        centres, radii = self.positions[row, kept], self.radii[row, kept]
        noisy = Disturbance(is_d435=True)
        frames = [
            eye.at(centres, radii, _FRAMES * row + number).heights(noisy)
            for number in range(_FRAMES)
        ]
        stack = np.array(frames)
        known = np.isfinite(stack)
        total = np.where(known, stack, 0.0).sum(axis=0)
        mean = np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)
        return eye.at(centres, radii, 0).points(mean, threshold)


@dataclass(frozen=True, eq=False)
class _Grain:
    """What one grain gave, by recipe.

    Attributes:
        estimates: parameters, own units.
        distances: L2 by height, of every recording with every forward pour.
        floor: L2 between recordings of one height, at 12 cm, shape (m, m).
        outside: whether the model can explain the recordings, in words.
    """

    estimates: dict[str, Array]
    distances: dict[str, dict[float, Array]]
    floor: Array
    outside: str

    @property
    def lacks_a_height(self) -> bool:
        """Whether a height has no recording or no pour that can be used."""
        return any(set(at) < {_CALIBRATED_AT, *_HEIGHTS} for at in self.distances.values())


def _set_name(name: str, number: int, height: float) -> str:
    return f"heights-{name}-{number}-{1e3 * height:.0f}mm"


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    variant = three.VARIANTS[0]
    scene, found = variant.scene(size), three.sets(size, variant)
    for name in _PAPER:
        found.append(PouredSet(f"heights-{name}-each", size.recordings[0], scene))
        found += [
            PouredSet(_set_name(name, number, height), _FORWARD, scene)
            for number in range(len(_RECIPES))
            for height in (_CALIBRATED_AT, *_HEIGHTS)
        ]
    return found


def run(workshop: Workshop) -> Outcome:
    """Calibrates both grains and predicts the other heights."""
    size, variant = workshop.size, three.VARIANTS[0]
    scene = variant.scene(workshop.size)
    training, _ = three.training_and_tests(workshop, variant)
    model = workshop.model(variant.name, training)
    sd = training.x.std(axis=0, ddof=1)
    rows: list[Row] = []
    tables, figures, found = [], [], {}
    for name, paper in _PAPER.items():
        recordings = Recordings.load(name, size, workshop.folder)
        found[name] = each = _calibrate(workshop, recordings, model, scene, sd)
        for recipe in _RECIPES:
            label = f"L2 at 12 cm, {name}, {recipe}"
            at = each.distances[recipe][_CALIBRATED_AT]
            # Every recording is held against the same pours.
            both = bootstrap_grid(at)
            rows.append(level_row(label, at.mean(axis=1), size, paper, interval=both))
        rows.append(_between(f"L2 between recordings at 12 cm, {name}", each.floor, size))
        tables.append(_table(name, each))
        file = _picture(workshop, recordings, scene, each.estimates[_RECIPES[1]])
        figures.append(
            Figure(
                file=file,
                caption=f"{name}: recordings of the other engine (top), "
                "pours of the calibrated model (bottom).",
            )
        )
    better = {n: f.distances[_RECIPES[1]][_CALIBRATED_AT].mean() for n, f in found.items()}
    return Outcome(
        rows=rows,
        answer="Calibrated on all recordings from 12 cm together, pours from there are "
        + " and ".join(f"{value:.2f} ({name})" for name, value in better.items())
        + " from the recordings in L2.",
        tables=tables,
        figures=figures,
        notes=[
            "The truth is LAMMPS, not a camera over real grains: Hertzian contacts, spheres of "
            "several sizes for couscous, rigid pairs of spheres for barley. Its laws and its noise "
            "are known to be kinder than those of reality.",
            "L2 is over the 16 statistics in standard deviations of the training set, as in the "
            "paper, between a recording and a pour; both the distance of their means and the "
            "scatter of single pours are in it.",
            *(f"{name}: {f.outside}" for name, f in found.items()),
            *([_NONE_USABLE] if any(f.lacks_a_height for f in found.values()) else []),
        ],
    )


def _calibrate(
    workshop: Workshop, recordings: Recordings, model: "BayesSim", scene: Scene, sd: Array
) -> _Grain:
    size, prior, name = workshop.size, model.prior, recordings.name
    eye, threshold = Eye.of(scene), scene.get("camera.height_threshold")

    def seen(height: float, count: int) -> Array:
        found = recordings.at(height, count)
        return np.array([recordings.statistics(row, eye, threshold) for row in found])

    x = seen(_CALIBRATED_AT, size.recordings[0])
    estimates = np.array([three.estimate(model.posterior(each)) for each in x])
    again = workshop.poured(f"heights-{name}-each", scene, prior, estimates, seed=_SEED)
    distance = np.linalg.norm((again - x) / sd, axis=1)
    best = np.argsort(np.where(np.isfinite(distance), distance, np.inf))[:_KEPT]
    chosen = {
        _RECIPES[0]: estimates[best].mean(axis=0),
        _RECIPES[1]: three.estimate(model.posterior(x)),
    }
    # Once for both recipes: a recording is ten frames of the sensor.
    measured = {height: seen(height, size.recordings[1]) for height in _HEIGHTS}
    measured[_CALIBRATED_AT] = x
    distances: dict[str, dict[float, Array]] = {}
    for number, (recipe, theta) in enumerate(chosen.items()):
        at = {}
        for height in (_CALIBRATED_AT, *_HEIGHTS):
            poured = workshop.poured(
                _set_name(name, number, height),
                scene.with_({"funnel.height": height}),
                prior,
                np.repeat(theta[None], _FORWARD, axis=0),
                seed=_SEED + 1,
            )
            poured = poured[np.isfinite(poured).all(axis=1)]
            if len(measured[height]) and len(poured):
                apart = (measured[height][:, None] - poured[None]) / sd
                at[height] = np.linalg.norm(apart, axis=2)
        distances[recipe] = at
    floor = np.linalg.norm((x[:, None] - x[None]) / sd, axis=2)
    misfit = model.misfit(x)
    words = "can" if misfit.is_inside else "cannot"
    outside = f"the model {words} explain the recordings at 12 cm (p = {misfit.p_value:.2g})."
    return _Grain(chosen, distances, floor, outside)


def _between(label: str, floor: Array, size: Size) -> Row:
    """The row of distances (m, m) between m recordings, of which each stands in m - 1 pairs."""
    pairs = floor[np.triu_indices(len(floor), 1)]
    interval = bootstrap_pairs(floor)
    return level_row(label, pairs, size, interval=interval, count=len(floor))


def _table(name: str, found: _Grain) -> Table:
    rows = []
    for recipe, theta in found.estimates.items():
        at = found.distances[recipe]
        cells = [
            f"{at[h].mean():.2f} ± {at[h].mean(axis=1).std():.2f}" if h in at else "none usable"
            for h in (_CALIBRATED_AT, *_HEIGHTS)
        ]
        rows.append([recipe, ", ".join(f"{value:.3g}" for value in theta), *cells])
    heights = [f"{100 * h:.0f} cm" for h in (_CALIBRATED_AT, *_HEIGHTS)]
    title = f"{name}: L2 at 12 cm, where it was calibrated, and at heights it had not seen"
    return Table(title=title, columns=["recipe", "parameters", *heights], rows=rows)


def _picture(workshop: Workshop, recordings: Recordings, scene: Scene, theta: Array) -> str:
    eye, threshold = Eye.of(scene), scene.get("camera.height_threshold")
    top, bottom, titles = [], [], []
    for height in (*_HEIGHTS, _CALIBRATED_AT):
        rows = recordings.at(height, 1)
        if not len(rows):
            continue
        at = scene_at(scene.with_({"funnel.height": height}), three.VARIANTS[0].prior, theta)
        top.append(recordings.points(int(rows[0]), eye, threshold))
        bottom.append(workshop.formation(at, _SEED))
        titles.append(f"{100 * height:.0f} cm")
    path = workshop.own / f"{recordings.name}.png"
    return formations(path, [top, bottom], ["recording", "model"], titles)


EXPERIMENT = Experiment(
    number=7,
    name="heights",
    title="Calibrate at one height, predict the others",
    section="Real-to-sim Parameter Estimation",
    asks="Do parameters calibrated on pours of another engine from 12 cm predict its pours from 2 "
    "to 10 cm?",
    run=run,
    sets=sets,
)
