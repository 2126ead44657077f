"""Experiment 6: cylinders and cubes as truth, spheres as model; and the right shape as model.

The truth is grains of 4 mm (cylinders as long as wide, cubes) whose sliding friction varies and
whose restitution is 0.5. A model of spheres infers its three parameters from their formations, and
spheres are poured at the estimates. Then a model of the right shape does the same: its grains have
no rolling friction, because edges and faces do that work, so that two parameters are left.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from granulcal.bayessim.posterior.posterior import Posterior
from granulcal.experiments.paper.common import three
from granulcal.experiments.paper.common.draw import formations
from granulcal.experiments.paper.common.experiment import Experiment
from granulcal.experiments.paper.common.measure import Published, level_row
from granulcal.experiments.paper.common.outcome import Figure, Outcome, Table
from granulcal.experiments.paper.common.poured_set import PouredSet
from granulcal.experiments.paper.common.sizes import Size
from granulcal.experiments.paper.common.workshop import Pairs, Workshop
from granulcal.pours.forward import scene_at
from granulcal.pours.left_out import LeftOut
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

if TYPE_CHECKING:
    from granulcal.bayessim import BayesSim

__all__ = [
    "EXPERIMENT",
    "OF_MODEL",
    "OF_TRUTH",
    "SHAPES",
    "Found",
    "Shape",
    "add_itself",
    "beside",
    "by_spheres",
    "shaped",
    "usable",
]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shape:
    """A shape of grains: its name, TOML's inline table, the paper's number, its seeds' first."""

    name: str
    table: str
    paper: Published
    seed: int

    def scene(self, size: Size) -> Scene:
        """Returns the paper's pour of grains of this shape."""
        return shaped(three.VARIANTS[0].scene(size), self.table)


SHAPES = (
    Shape(
        "cubes",
        '{ kind = "box", aspect = [1.0, 1.0, 1.0] }',
        Published(mean=1.8301, sd=1.9275, count=50),
        611,
    ),
    Shape(
        "cylinders",
        '{ kind = "cylinder", aspect = 1.0 }',
        Published(mean=4.0139, sd=1.0574, count=50),
        601,
    ),
)
"""What takes less time first."""
_EXAMPLES, _PICTURE_SEED = 5, 601
_SLIDING, _RESTITUTION = "material.sliding_friction", "material.restitution"
OF_TRUTH = Prior(
    [
        Parameter(path=_SLIDING, distribution="uniform", low=0.01, high=1.0),
        Parameter(path=_RESTITUTION, distribution="fixed", value=0.5),
    ]
)
OF_MODEL = Prior(
    [
        Parameter(path=_SLIDING, distribution="uniform", low=0.0, high=1.0),
        Parameter(path=_RESTITUTION, distribution="uniform", low=0.0, high=1.0),
    ]
)
"""What is unknown of grains with a shape."""


def shaped(scene: Scene, shape: str) -> Scene:
    """Returns the scene with grains of a shape, as TOML's inline table."""
    return Scene.from_toml(scene.to_toml().replace("[grains]\n", f"[grains]\nshape = {shape}\n", 1))


@dataclass
class Found:
    """What has been found of a shape so far.

    Attributes:
        tests: formations of known sliding friction.
        unexplained: share of them that no spheres explain [-].
        by_spheres: L2 of spheres at the parameters inferred by the model of spheres, shape (n,);
            here and below NaN where a pour cannot be used.
        errors_by_spheres: of the sliding friction by that model, shape (n,).
        height: of the heaps of these spheres over that of the tests', mean over mean [-].
        figure: formations beside those of the spheres; None without.
        floor: L2 of a second pour of each test, shape (n,); None: not poured yet.
        by_itself: L2 of grains of the shape at what the model of the shape infers, shape (n,).
        errors: of the sliding friction by that model, shape (n,).
        unusable: its training pours that could not be used.
    """

    tests: Pairs
    unexplained: float
    by_spheres: Array
    errors_by_spheres: Array
    height: float
    figure: Figure | None
    floor: Array | None = None
    by_itself: Array | None = None
    errors: Array | None = None
    unusable: LeftOut | None = None


def sets(size: Size) -> list[PouredSet]:
    """Returns the pours of this experiment."""
    variant = three.VARIANTS[0]
    spheres = variant.scene(size)
    found = three.sets(size, variant)
    for shape in SHAPES:
        name, scene = shape.name, shape.scene(size)
        found += [
            PouredSet(f"{name}-tests", size.tests, scene),
            PouredSet(f"{name}-by-spheres", size.tests, spheres),
            PouredSet(f"{name}-floor", size.tests, scene),
            PouredSet(f"{name}-training", size.shapes, scene),
            PouredSet(f"{name}-by-{name}", size.tests, scene),
        ]
    return found


def run(workshop: Workshop) -> Outcome:
    """Infers each shape with spheres, pours each test again, then infers with the shape itself."""
    training, _ = three.training_and_tests(workshop, three.VARIANTS[0])
    sd = training.x.std(axis=0, ddof=1)
    round_model = workshop.model(three.VARIANTS[0].name, training)
    found: dict[str, Found] = {}
    for shape in SHAPES:
        found[shape.name] = by_spheres(workshop, shape, round_model, sd)
        workshop.so_far(_outcome(workshop.size, found))
        _add_floor(workshop, shape, found[shape.name], sd)
        workshop.so_far(_outcome(workshop.size, found))
        add_itself(workshop, shape, found[shape.name], sd)
        workshop.so_far(_outcome(workshop.size, found))
    return _outcome(workshop.size, found)


def by_spheres(
    workshop: Workshop, shape: Shape, model: "BayesSim", sd: Array, *, picture: bool = True
) -> Found:
    """Pours the tests of a shape, infers them with a model of spheres, and pours spheres there.

    Args:
        workshop: where the pours are kept.
        shape: of the tests.
        model: of spheres.
        sd: of its training set's statistics, shape (s,).
        picture: pour some of the tests again, for a picture.
    """
    variant = three.VARIANTS[0]
    spheres = variant.scene(workshop.size)
    scene, name = shape.scene(workshop.size), shape.name
    tests = workshop.tests(f"{name}-tests", scene, OF_TRUTH, workshop.size.tests, shape.seed)
    estimates, x = _again(workshop, f"{name}-by-spheres", model.posterior, tests,
                          spheres, variant.prior, shape.seed + 2)  # fmt: skip
    figure = None
    if picture:
        file = _picture(workshop, name, scene, tests, spheres, variant.prior, estimates)
        caption = f"{name} (top), and spheres at the parameters inferred from them (bottom)."
        figure = Figure(file=file, caption=caption)
    return Found(
        tests=tests,
        unexplained=float(np.mean([not model.misfit(x).is_inside for x in tests.x])),
        by_spheres=_distances(x, tests.x, sd),
        errors_by_spheres=estimates[:, 0] - tests.theta[:, 0],
        height=_height(x, tests),
        figure=figure,
    )


def _add_floor(workshop: Workshop, shape: Shape, found: Found, sd: Array) -> None:
    tests, scene = found.tests, shape.scene(workshop.size)
    theta = np.column_stack([tests.theta[:, 0], np.full(len(tests), 0.5)])
    name, seed = f"{shape.name}-floor", shape.seed + 4
    found.floor = _distances(workshop.poured(name, scene, OF_MODEL, theta, seed=seed), tests.x, sd)


def add_itself(workshop: Workshop, shape: Shape, found: Found, sd: Array) -> None:
    """Infers the tests of a shape with a model of that shape, and pours at what it says."""
    tests, name, scene = found.tests, shape.name, shape.scene(workshop.size)
    right = workshop.pairs(
        f"{name}-training", scene, OF_MODEL, workshop.size.shapes, shape.seed + 1
    )
    model = workshop.model(name, right)
    estimates, x = _again(workshop, f"{name}-by-{name}", model.posterior, tests,
                          scene, OF_MODEL, shape.seed + 3)  # fmt: skip
    found.by_itself = _distances(x, tests.x, sd)
    found.errors = estimates[:, 0] - tests.theta[:, 0]
    found.unusable = right.unusable


def _outcome(size: Size, found: dict[str, Found]) -> Outcome:
    """What has been found so far."""
    rows, cells, compared, missing = [], [], [], []
    for shape in SHAPES:
        name, each = shape.name, found.get(shape.name)
        if each is None:
            missing.append(f"{name} by spheres")
            continue
        rows.append(level_row(f"L2, {name} by spheres", usable(each.by_spheres), size, shape.paper))
        if each.by_itself is None:
            missing.append(f"{name} by {name}")
        else:
            rows.append(level_row(f"L2, {name} by {name}", usable(each.by_itself), size))
        floor = f"L2 of two pours of one material, {name} (floor)"
        if each.floor is None:
            missing.append(floor)
        else:
            rows.append(level_row(floor, usable(each.floor), size))
        if each.floor is not None and each.by_itself is not None:
            compared.append([name, *beside(each.by_spheres, each.by_itself, each.floor)])
        unusable = "-" if each.unusable is None else str(each.unusable)
        spheres = [f"{each.unexplained:.0%}", f"{each.height:.0%}", _spread(each.errors_by_spheres)]
        cells.append([name, *spheres, _spread(each.errors), unusable, str(each.tests.unusable)])
    of_models = Table(
        title="The models of the two shapes",
        columns=[
            "shape",
            "formations that no spheres explain (5 % by chance)",
            "height of the spheres' heaps against the shape's",
            "error of the sliding friction, spheres",
            "the same, right shape",
            "training pours not usable",
            "test pours not usable",
        ],
        rows=cells,
    )
    of_all_three = Table(
        title="The formations of which all three pours can be used",
        columns=[
            "shape",
            "formations",
            "L2 by spheres",
            "by itself",
            "of second pours",
            "nearer by itself than by spheres, with its standard error",
        ],
        rows=compared,
    )
    return Outcome(
        rows=rows,
        answer="; ".join(f"{row.quantity}: {row.ours}" for row in rows),
        missing=missing,
        tables=[of_models, of_all_three] if compared else [of_models],
        figures=[each.figure for each in found.values() if each.figure is not None],
        notes=[
            "Distances are in standard deviations of the training set of spheres, as everywhere.",
            "Grains with a shape have the same diameter of 4 mm as the spheres, not the same "
            "volume, as in the paper.",
            "The model of the right shape has two unknowns, sliding friction and restitution.",
        ],
    )


def beside(by_spheres: Array, by_itself: Array, *others: Array) -> list[str]:
    """Pours of each formation, where none is missing: their number and mean distances."""
    each = np.column_stack([by_spheres, by_itself, *others])
    each = each[np.isfinite(each).all(axis=1)]
    if len(each) < 2:
        return [str(len(each)), *["-"] * (each.shape[1] + 1)]
    nearer = each[:, 0] - each[:, 1]
    error = nearer.std(ddof=1) / np.sqrt(len(nearer))
    means = [f"{mean:.2f}" for mean in each.mean(axis=0)]
    return [str(len(nearer)), *means, f"{nearer.mean():.2f} ± {error:.2f}"]


def _height(x: Array, tests: Pairs) -> float:
    """Mean height of pours over that of the tests, of those that can be used."""
    heights = np.column_stack([each[:, tests.names.index("max_z")] for each in (x, tests.x)])
    again, first = heights[np.isfinite(heights).all(axis=1)].mean(axis=0)
    return float(again / first)


def _spread(errors: Array | None) -> str:
    return "-" if errors is None else f"{errors.mean():.3f} ± {errors.std(ddof=1):.3f}"


def usable(distances: Array) -> Array:
    """Returns the distances that are none of pours that cannot be used."""
    return distances[np.isfinite(distances)]


def _again(
    workshop: Workshop,
    name: str,
    infer: Callable[[Array], Posterior],
    tests: Pairs,
    scene: Scene,
    prior: Prior,
    seed: int,
) -> tuple[Array, Array]:
    """Estimates of the tests, and what pours at them show."""
    estimates = np.array([three.estimate(infer(x)) for x in tests.x])
    return estimates, workshop.poured(name, scene, prior, estimates, seed=seed)


def _distances(x: Array, against: Array, sd: Array) -> Array:
    return np.linalg.norm((x - against) / sd, axis=1)


def _picture(
    workshop: Workshop,
    name: str,
    scene: Scene,
    tests: Pairs,
    spheres: Scene,
    prior: Prior,
    estimates: Array,
) -> str:
    """Pours the first tests again, in both shapes, for their pictures."""
    top, bottom, titles = [], [], []
    workshop.say(f"{name}: {_EXAMPLES} formations of each shape for the picture")
    for truth, theta in list(zip(tests.theta, estimates, strict=True))[:_EXAMPLES]:
        top.append(workshop.formation(scene_at(scene, OF_TRUTH, truth), _PICTURE_SEED))
        bottom.append(workshop.formation(scene_at(spheres, prior, theta), _PICTURE_SEED))
        titles.append(f"sliding friction {truth[0]:.2f}")
    return formations(workshop.own / f"{name}.png", [top, bottom], [name, "spheres"], titles)


EXPERIMENT = Experiment(
    number=6,
    name="shapes",
    title="Mismatch of shapes",
    section="Sim-to-sim Parameter Estimation",
    asks="How well do spheres stand for cylinders and cubes, and what does the right shape mend?",
    run=run,
    sets=sets,
)
