"""How often the residual test calls a right surrogate wrong, by the size of the archive.

    python benches/loop_level.py            # three sizes, 300 sets each: a quarter of an hour

The simulator is a closed form: 12 statistics, smooth in three parameters, one number of the
condition and five effects, with Gaussian noise. Sets have no effect and three conditions, so that
p is uniform if the test is level.
"""

import argparse

import numpy as np
from numpy.typing import NDArray

from granulcal.loop.effects.design import Design, Effect
from granulcal.loop.surrogate.baseline import fit_base
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.residual_test import residual_test
from granulcal.loop.test.score import Scores

Array = NDArray[np.float64]

PARAMETERS, EFFECTS, STATISTICS, HIDDEN = 3, 5, 12, 20
CONDITIONS = (0.1, 0.5, 0.9)
SIZES = ((300, 40, 3), (700, 80, 3), (1500, 150, 3), (1500, 150, 10))
"""Pours of the base and of each effect, and recordings under each condition."""
NOISE = 0.15
ARCHIVES = 5
LEVELS = (0.05, 0.01)


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

    def pours(self, unit: Array, psi: Array, random: np.random.Generator) -> Array:
        """Returns the statistics of pours, shape (n, s)."""
        hidden = np.tanh((2 * unit - 1) @ self.inner + self.shift + psi @ self.of_effects)
        noise = random.standard_normal((len(unit), STATISTICS)) @ self.root.T
        return hidden @ self.outer + NOISE * noise


def p_values(truth: Truth, base: int, each: int, recordings: int, sets: int) -> Array:
    """Returns the p-value of each set, shape (n,)."""
    effects = tuple(Effect(f"effect {k}") for k in range(EFFECTS))
    names = tuple(f"parameter {i}" for i in range(PARAMETERS))
    design = Design(names, ("condition",), effects)
    found = []
    for archive in range(ARCHIVES):
        random = np.random.default_rng(100 + archive)
        count = base + EFFECTS * each
        unit, psi = random.random((count, PARAMETERS + 1)), np.zeros((count, EFFECTS))
        for k in range(EFFECTS):
            psi[base + k * each : base + (k + 1) * each, k] = random.random(each)
        x = truth.pours(unit, psi, random)
        surrogate = Surrogate.fit(design, unit[:, :PARAMETERS], unit[:, PARAMETERS:], psi, x)
        for number in range(sets // ARCHIVES):
            theta, none = random.random(PARAMETERS), np.zeros((recordings, EFFECTS))
            seen = []
            for at in CONDITIONS:
                where = np.tile(np.append(theta, at), (recordings, 1))
                rows = truth.pours(where, none, random)
                seen.append(ConditionPours.of(str(at), [at], rows))
            local, fit = fit_base(surrogate, StackedMeans.of(surrogate, seen), number)
            scores = Scores.of(local, fit, design.candidates)
            test = residual_test(local, fit, scores, replicates=1000, refits=16, seed=number)
            found.append(test.p)
    return np.array(found)


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sets", type=int, default=300)
    sets = parser.parse_args().sets
    print("| pours of the base | of each effect | recordings | p <= 0.05 | p <= 0.01 | sets |")
    print("|---|---|---|---|---|---|")
    truth = Truth(7)
    for base, each, recordings in SIZES:
        p = p_values(truth, base, each, recordings, sets)
        shares = " | ".join(f"{np.mean(p <= level):.1%}" for level in LEVELS)
        print(f"| {base} | {each} | {recordings} | {shares} | {len(p)} |", flush=True)


if __name__ == "__main__":
    main()
