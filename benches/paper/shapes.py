"""What experiment 6 (`granulcal reproduce paper shapes --medium`) owes to chance and to its size.

    python benches/paper/shapes.py again    # another 50 tests of each shape, by spheres
    python benches/paper/shapes.py few      # models of the right shape from fewer training pours

Both go on with the pours below `--out` (default: out/paper-medium, where the experiment keeps
them), and can be stopped and started again.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from granulcal.experiments.paper.common import three
from granulcal.experiments.paper.common.sizes import MEDIUM
from granulcal.experiments.paper.common.workshop import Workshop
from granulcal.experiments.paper.shapes import OF_MODEL, OF_TRUTH, SHAPES, by_spheres

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


def main() -> None:
    """Runs what the command line names."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("what", choices=["again", "few"])
    parser.add_argument("--out", type=Path, default=Path("out/paper-medium"))
    parser.add_argument("--threads", type=int, default=2, help="pours at once")
    args = parser.parse_args()
    workshop = Workshop(args.out, f"shapes-{args.what}", MEDIUM, threads=args.threads)
    (again if args.what == "again" else few)(workshop)


if __name__ == "__main__":
    main()
