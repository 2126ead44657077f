"""What experiment 6 (`granulcal reproduce paper shapes`) owes to chance and to its size.

    python benches/paper/shapes.py again    # another 50 tests of each shape, by spheres
    python benches/paper/shapes.py few      # models of the right shape from fewer training pours
    python benches/paper/shapes.py itself   # of 2,000 grains: cylinders by cylinders, 50 tests

The first two are of 400 grains (`--medium`). All go on with the pours below `--out` (default:
out/paper-medium and out/paper, where the experiment keeps them), and can be stopped and started
again.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from granulcal.bayessim import BayesSim
from granulcal.experiments.paper.common import three
from granulcal.experiments.paper.common.measure import bootstrap
from granulcal.experiments.paper.common.sizes import FULL, MEDIUM, Size
from granulcal.experiments.paper.common.workshop import Workshop
from granulcal.experiments.paper.shapes import (
    OF_MODEL,
    OF_TRUTH,
    SHAPES,
    add_itself,
    beside,
    by_spheres,
    usable,
)
from granulcal.starter.models import model_named

OTHER_SEEDS = 1000
"""Added to the seeds of the experiment."""
FEWER = (50, 75, MEDIUM.shapes)
"""Training pours of a shape."""
RESAMPLED = 2000


def again(workshop: Workshop) -> None:
    """Prints L2 of spheres at the estimates of other tests."""
    training, _ = three.training_and_tests(workshop, three.VARIANTS[0])
    sd = training.x.std(axis=0, ddof=1)
    model = workshop.model(three.VARIANTS[0].name, training)
    for shape in SHAPES:
        other = replace(shape, name=f"{shape.name}-again", seed=shape.seed + OTHER_SEEDS)
        found = by_spheres(workshop, other, model, sd)
        distance = found.by_spheres[np.isfinite(found.by_spheres)]
        print(
            f"{shape.name} by spheres: L2 {distance.mean():.2f} ± {distance.std(ddof=1):.2f} "
            f"(n = {len(distance)}), no spheres explain {found.unexplained:.0%}",
            flush=True,
        )


def few(workshop: Workshop) -> None:
    """Prints the error of the sliding friction after fewer training pours."""
    size = workshop.size
    for shape in SHAPES:
        scene, name = shape.scene(size), shape.name
        tests = workshop.tests(f"{name}-tests", scene, OF_TRUTH, size.tests, shape.seed)
        right = workshop.pairs(f"{name}-training", scene, OF_MODEL, size.shapes, shape.seed + 1)
        for count in FEWER:
            used = right.first(count)
            model = workshop.model(f"{name}-few-{count}", used)
            estimates = np.array([three.estimate(model.posterior(x))[0] for x in tests.x])
            squares = (estimates - tests.theta[:, 0]) ** 2
            drawn = np.random.default_rng(0).choice(squares, (RESAMPLED, len(squares)))
            low, high = np.sqrt(np.quantile(drawn.mean(axis=1), [0.025, 0.975]))
            print(
                f"{name} from {len(used)} pours: sliding friction off by "
                f"{np.sqrt(squares.mean()):.3f} rms (95 % {low:.3f} to {high:.3f})",
                flush=True,
            )


def itself(workshop: Workshop, name: str) -> None:
    """Prints L2 of a shape by spheres and by itself; the model of spheres is the one that ships."""
    shape = next(each for each in SHAPES if each.name == name)
    variant = three.VARIANTS[0]
    scene = variant.scene(workshop.size)
    spheres = workshop.pairs(
        f"{variant.name}-training", scene, variant.prior, workshop.size.training, variant.seed
    )
    sd = spheres.x.std(axis=0, ddof=1)
    found = by_spheres(workshop, shape, BayesSim.load(model_named("funnel")), sd, picture=False)
    add_itself(workshop, shape, found, sd)
    by_itself, errors = found.by_itself, found.errors
    assert by_itself is not None and errors is not None
    for what, each in (("spheres", found.by_spheres), (name, by_itself)):
        distance = usable(each)
        low, high = bootstrap(distance)
        print(
            f"{name} by {what}: L2 {distance.mean():.4f} ± {distance.std(ddof=1):.4f} "
            f"(n = {len(distance)}, 95 % of the mean {low:.4f} to {high:.4f}), "
            f"median {np.median(distance):.2f}"
        )
    told = ", ".join(beside(found.by_spheres, by_itself))
    print(f"both usable; L2 by spheres, by {name}; nearer by {name}, standard error: {told}")
    for what, off in (("spheres", found.errors_by_spheres), (name, errors)):
        print(f"sliding friction by {what}: off by {off.mean():.3f} ± {off.std(ddof=1):.3f}")
    print(f"training pours not usable: {found.unusable}; tests: {found.tests.unusable}")


def main() -> None:
    """Runs what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=["again", "few", "itself"])
    parser.add_argument("--out", type=Path, help="folder of the experiment's pours")
    parser.add_argument("--threads", type=int, default=2, help="pours at once")
    of_itself = parser.add_argument_group("itself")
    of_itself.add_argument("--shape", default="cylinders", choices=[s.name for s in SHAPES])
    of_itself.add_argument("--tests", type=int, default=FULL.tests)
    of_itself.add_argument("--training", type=int, default=FULL.shapes, help="of the shape")
    of_itself.add_argument(
        "--scale", type=int, default=FULL.training, help="pours of spheres that L2 is scaled by"
    )
    args = parser.parse_args()
    size: Size = MEDIUM
    if args.what == "itself":
        size = replace(FULL, tests=args.tests, shapes=args.training, training=args.scale)
    folder = args.out or Path("out/paper" if args.what == "itself" else "out/paper-medium")
    workshop = Workshop(folder, f"shapes-{args.what}", size, threads=args.threads)
    if args.what == "itself":
        itself(workshop, args.shape)
    else:
        (again if args.what == "again" else few)(workshop)


if __name__ == "__main__":
    main()
