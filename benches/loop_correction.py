"""How much of the misfit the correction without physics removes where nothing was fitted.

    python benches/loop_correction.py --seed 101 --sets 96 --pours 3

The stand-in of `benches/loop_pile.py`: sets with something that the library does not have, or one
strong effect that it has; a few pours at each of three heights, the misfit at three others, one of
them outside. Beside the correction of `loop/check/discrepancy.py` stand its form that leaves the
parameters what they could have done (Plumlee 2017), the straight line through the residuals, and
the straight line through the data.
"""

import argparse

import numpy as np
from loop_pile import HIDDEN, PileLoopToy
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Discrepancy, Surrogate
from granulcal.loop.check.trivial import line_weights
from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.surrogate.baseline import Fit, fit_base
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.test.score import DISCREPANCY_LENGTH

Array = NDArray[np.float64]

FIT, SEALED, MANY = (0.2, 0.6, 1.0), (0.0, 0.4, 0.8), 40
HEAD = 16


def constrained(local: LinearisedSurrogate, fit: Fit, at: Array) -> Array:
    """Returns the correction orthogonal to the parameters, of one kernel and no pooled size."""
    count, size = len(local.conditions), local.surrogate.size
    root, slopes = local.in_statistics(fit.root), local.in_statistics(fit.slopes)
    residual, covariance = local.in_statistics(fit.residual[:, None])[:, 0], root @ root.T
    bound = np.linalg.solve(covariance, slopes)
    left = covariance - slopes @ np.linalg.solve(slopes.T @ bound + np.eye(len(fit.v)), slopes.T)
    own = np.maximum((residual**2 - np.diag(left)).reshape(count, size).mean(axis=0), 0.0)

    def plain(a: Array, b: Array) -> Array:
        gap = np.sum((a[:, None] - b[None]) ** 2, axis=2)
        return np.kron(np.exp(-0.5 * gap / DISCREPANCY_LENGTH**2), np.diag(own))

    inner = np.linalg.pinv(
        bound.T @ plain(local.conditions, local.conditions) @ bound, hermitian=True
    )

    def kernel(a: Array, b: Array) -> Array:
        side = plain(a, local.conditions) @ bound
        return plain(a, b) - side @ inner @ bound.T @ plain(local.conditions, b)

    whole = kernel(local.conditions, local.conditions) + covariance
    return kernel(at[None], local.conditions) @ np.linalg.solve(whole, residual)


def one_set(toy: PileLoopToy, surrogate: Surrogate, seed: int, index: int, pours: int) -> Array:
    """Returns D^2 at the sealed heights: plain, corrected, constrained, of both lines."""
    generator = np.random.default_rng([seed, index])
    theta, psi, hidden = generator.uniform(0.05, 0.95, 3), np.zeros(8), dict[str, float]()
    if index % 4 < 3:
        hidden = {HIDDEN[index % 4]: (0.5, 1.0)[(index // 4) % 2]}
    else:
        psi[generator.integers(8)] = 0.8

    def pour(t: Array, h: float, p: Array, n: int, lacking: dict[str, float]) -> Array:
        rows = np.tile(t, (n, 1)), np.full((n, 1), h), np.tile(p, (n, 1))
        return toy.simulate(*rows, generator, lacking)

    seen = [pour(theta, h, psi, pours, hidden) for h in FIT]
    stack = StackedMeans.of(
        surrogate, [ConditionPours.of("", [h], x) for h, x in zip(FIT, seen, strict=True)]
    )
    local, fit = fit_base(surrogate, stack, index)
    found = cube_from_normal(fit.v)

    def scaled(rows: Array) -> Array:
        return surrogate.standardise(rows) @ surrogate.from_axes

    none = np.zeros(8)
    fitted = [scaled(pour(found, h, none, MANY, {})).mean(axis=0) for h in FIT]
    data = np.array([scaled(x).mean(axis=0) for x in seen])
    residual, places = data - np.array(fitted), np.array(FIT)[:, None]
    correction, total = Discrepancy.of(local, fit), np.zeros(5)
    for h in SEALED:
        at = np.array([h])
        y, x = scaled(pour(theta, h, psi, MANY, hidden)), scaled(pour(found, h, none, MANY, {}))
        noise = (y.var(axis=0, ddof=1) + x.var(axis=0, ddof=1)) / MANY
        gap, line = y.mean(axis=0) - x.mean(axis=0), line_weights(places, at)
        assert line is not None
        left = (
            gap,
            gap - correction.predict(at)[0],
            gap - constrained(local, fit, at),
            gap - line @ residual,
            y.mean(axis=0) - line @ data,
        )
        total += [float((one**2 - noise)[:HEAD].sum()) for one in left]
    return total


def main() -> None:
    """Prints the share removed: quartiles over the sets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=101)
    parser.add_argument("--sets", type=int, default=96)
    parser.add_argument("--pours", type=int, default=3)
    options = parser.parse_args()
    toy = PileLoopToy()
    surrogate = Surrogate.fit(toy.design, *toy.archive(1500, 150, 100), names=toy.names)
    squares = np.array(
        [one_set(toy, surrogate, options.seed, i, options.pours) for i in range(options.sets)]
    )
    told = squares[squares[:, 0] > 0.5]
    names = ("correction", "orthogonal to the parameters", "line of residuals", "line of data")
    print(f"| {len(told)} sets | lower quartile | median | upper quartile |\n|---|---|---|---|")
    for j, name in enumerate(names, start=1):
        low, middle, high = np.quantile(1 - told[:, j] / told[:, 0], [0.25, 0.5, 0.75])
        print(f"| {name} | {low:.2f} | {middle:.2f} | {high:.2f} |")


if __name__ == "__main__":
    main()
