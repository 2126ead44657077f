"""How often the residual test calls a right surrogate wrong, by the size of the archive.

    python benches/loop_level.py            # four sizes, 300 sets each: ten minutes of a core
    python benches/loop_level.py --own      # means drawn from the surrogate's own law

The simulator is a closed form: 12 statistics, smooth in three parameters, one number of the
condition and five effects, with Gaussian noise. Sets have no effect and three conditions, so that
p is uniform if the test is level. Of the mean's error it also prints the square over the variance
that the surrogate claims. With `--own` the measured means are draws of what the surrogate says of
them, its own error included: what is not level then is the test's.
"""

import argparse

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import Design, Effect, normal_from_cube
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.base_test import base_test
from granulcal.loop.test.thresholds import Thresholds

Array = NDArray[np.float64]

PARAMETERS, EFFECTS, STATISTICS, HIDDEN = 3, 5, 12, 20
CONDITIONS = (0.1, 0.5, 0.9)
SIZES = ((300, 40, 3), (700, 80, 3), (1500, 150, 3), (1500, 150, 10))
"""Pours of the base and of each effect, and recordings under each condition."""
NOISE = 0.15
ARCHIVES = 10
LEVELS = (0.05, 0.01)
RULES = Thresholds(replicates=1000, refits=16)


class Truth:
    """The closed form."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        self.inner = 0.8 * random.standard_normal((PARAMETERS + 1, HIDDEN))
        self.shift = random.standard_normal(HIDDEN)
        self.outer = random.standard_normal((HIDDEN, STATISTICS)) / np.sqrt(HIDDEN)
        self.of_effects = 0.7 * random.standard_normal((EFFECTS, HIDDEN))
        shared = random.standard_normal((STATISTICS, 3))
        half = 0.5 * np.eye(STATISTICS) + 0.5 * shared @ shared.T / 3
        self.root = np.linalg.cholesky(half)

    def mean(self, unit: Array, psi: Array) -> Array:
        """Returns the statistics without noise, shape (n, s)."""
        hidden = np.tanh((2 * unit - 1) @ self.inner + self.shift + psi @ self.of_effects)
        return hidden @ self.outer

    def pours(self, unit: Array, psi: Array, random: np.random.Generator) -> Array:
        """Returns the statistics of pours, shape (n, s)."""
        noise = random.standard_normal((len(unit), STATISTICS)) @ self.root.T
        return self.mean(unit, psi) + NOISE * noise


def own_means(
    surrogate: Surrogate, theta: Array, recordings: int, random: np.random.Generator
) -> StackedMeans:
    """Returns means as the surrogate says that they are, its own error included."""
    places, count = np.array(CONDITIONS)[:, None], np.full(len(CONDITIONS), float(recordings))
    v, none = normal_from_cube(theta), surrogate.design.none()
    local = LinearisedSurrogate.at(surrogate, places, count, v)
    root = np.linalg.cholesky(local.covariance(v, none) + 1e-9 * np.eye(local.size))
    means = local.mean(v, none) + root @ random.standard_normal(local.size)
    names, sessions = tuple(map(str, CONDITIONS)), np.arange(len(CONDITIONS))
    return StackedMeans(names, places, means.reshape(len(places), -1), count, sessions)


def squared_over_claimed(truth: Truth, surrogate: Surrogate, random: np.random.Generator) -> float:
    """Returns the mean's squared error over the variance that the surrogate claims."""
    unit, none = random.random((1000, PARAMETERS + 1)), np.zeros((1000, EFFECTS))
    at = unit[:, :PARAMETERS], unit[:, PARAMETERS:], none
    error = surrogate.standardise(truth.mean(unit, none)) - surrogate.mean(*at)
    features = surrogate.features(*at)
    claimed = np.stack([np.sum((features @ b) ** 2, axis=1) for b in surrogate.roots], axis=1)
    claimed += surrogate.lack * surrogate.scale(*at) ** 2
    return float(np.mean(error**2 / claimed))


def p_values(
    truth: Truth, base: int, each: int, recordings: int, sets: int, is_own: bool
) -> tuple[Array, Array, float]:
    """Returns each set's p-value and whether its parameters are inner ones; the error's ratio."""
    effects = tuple(Effect(f"effect {k}") for k in range(EFFECTS))
    names = tuple(f"parameter {i}" for i in range(PARAMETERS))
    design = Design(names, ("condition",), effects)
    found, inner, ratios = [], [], []
    for archive in range(ARCHIVES):
        random = np.random.default_rng(100 + archive)
        count = base + EFFECTS * each
        unit, psi = random.random((count, PARAMETERS + 1)), np.zeros((count, EFFECTS))
        for k in range(EFFECTS):
            psi[base + k * each : base + (k + 1) * each, k] = random.random(each)
        x = truth.pours(unit, psi, random)
        surrogate = Surrogate.fit(design, unit[:, :PARAMETERS], unit[:, PARAMETERS:], psi, x)
        ratios.append(squared_over_claimed(truth, surrogate, np.random.default_rng(archive)))
        for number in range(sets // ARCHIVES):
            theta, none = random.random(PARAMETERS), np.zeros((recordings, EFFECTS))
            if is_own:
                stack = own_means(surrogate, theta, recordings, random)
            else:
                seen = []
                for at in CONDITIONS:
                    where = np.tile(np.append(theta, at), (recordings, 1))
                    rows = truth.pours(where, none, random)
                    seen.append(ConditionPours.of(str(at), [at], rows))
                stack = StackedMeans.of(surrogate, seen)
            found.append(base_test(surrogate, stack, RULES, number).test.p)
            inner.append(bool(np.abs(theta - 0.5).max() < 0.4))
    return np.array(found), np.array(inner), float(np.mean(ratios))


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=300)
    parser.add_argument("--own", action="store_true", help="means of the surrogate's own law")
    options = parser.parse_args()
    print("| base | of each effect | recordings | p <= 0.05 | p <= 0.01 | inner | outer | error |")
    print("|---|---|---|---|---|---|---|---|")
    truth = Truth(7)
    for base, each, recordings in SIZES:
        p, inner, ratio = p_values(truth, base, each, recordings, options.sets, options.own)
        shares = " | ".join(f"{np.mean(p <= level):.1%}" for level in LEVELS)
        parts = " | ".join(f"{np.mean(p[rows] <= LEVELS[0]):.1%}" for rows in (inner, ~inner))
        print(f"| {base} | {each} | {recordings} | {shares} | {parts} | {ratio:.2f} |", flush=True)


if __name__ == "__main__":
    main()
