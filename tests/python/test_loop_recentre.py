"""A verdict's own pours in place of a surrogate that is wrong at the fit."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import ConditionPours, Design, Effect, Surrogate, Thresholds
from granulcal.loop.check.recentre import recentre
from granulcal.loop.effects.design import cube_from_normal
from granulcal.loop.surrogate.baseline import fit_base
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.test.refit import fit_single

Array = NDArray[np.float64]

RULES = Thresholds(replicates_after=200, refits=32)
SIZE, POURS, FRESH, SETS = 6, 3, 10, 40
TRUTH, U = 0.5, 0.4


@dataclass(frozen=True)
class Linear:
    """x = A (2 u - 1) + psi D + alien B + offset D + noise."""

    slopes: Array
    directions: Array
    alien: Array

    def pours(
        self, u: Array, psi: Array, seed: int, *, alien: float = 0.0, offset: float = 0.0
    ) -> Array:
        noise = 0.4 * np.random.default_rng(seed).standard_normal((len(u), SIZE))
        mean = (2 * u[:, None] - 1) * self.slopes + psi @ self.directions
        return mean + alien * self.alien + offset * self.directions[0] + noise

    def observe(
        self, u: float, psi: float, seed: int, count: int, alien: float = 0.0
    ) -> ConditionPours:
        strengths = np.tile([psi, 0.0], (count, 1))
        return ConditionPours.of(
            "one", [], self.pours(np.full(count, u), strengths, seed, alien=alien)
        )


@pytest.fixture(scope="module")
def linear() -> Linear:
    generator = np.random.default_rng(8)
    slopes, first, second, alien = generator.standard_normal((4, SIZE))
    return Linear(slopes, 2 * np.stack([first, second]), alien)


@pytest.fixture(scope="module")
def wrong(linear: Linear) -> Surrogate:
    """A surrogate whose mean is off by 0.3 of the first effect, which it does not know."""
    generator = np.random.default_rng(1)
    u, psi = generator.random(320), np.zeros((320, 2))
    psi[200:260, 0], psi[260:, 1] = generator.random((2, 60))
    x = linear.pours(u, psi, 2, offset=0.3)
    design = Design(("a",), (), (Effect("first"), Effect("second")))
    return Surrogate.fit(design, u[:, None], np.zeros((320, 0)), psi, x, features=4)


@pytest.mark.parametrize("alien", [0.0, 2.5])
def test_fresh_pours_mend_a_strength_and_see_what_is_left(
    linear: Linear, wrong: Surrogate, alien: float
) -> None:
    plain, held, small = 0, 0, 0
    for number in range(SETS):
        measured = [linear.observe(U, TRUTH, 1000 + number, POURS, alien)]
        stack = StackedMeans.of(wrong, measured)
        local, base = fit_base(wrong, stack, number)
        model = fit_single(local, stack.means.ravel(), base, 0, RULES)
        u, psi = float(cube_from_normal(model.fit.v)[0]), float(model.fit.psi[0])
        fresh = [linear.observe(u, psi, 5000 + number, FRESH)]
        found = recentre(wrong, model.fit, measured, fresh, RULES, seed=number)
        low, high = model.intervals[0]
        plain += low <= TRUTH <= high
        low, high = found.intervals[0]
        held += low <= TRUTH <= high
        small += found.residual_test.p <= RULES.adequate
    if alien:
        # No strength of the first effect explains the alien.
        assert small >= 0.8 * SETS
    else:
        assert plain <= 0.4 * SETS
        # 95 % of 40: fewer than 34 has a chance of 1 in 300.
        assert held >= 34 and small <= 4
