"""Evidence of strengths that lie at an end of their prior, or that pours put beyond one."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Thresholds
from granulcal.loop.check import by_pours
from granulcal.loop.surrogate.baseline import Fit, summarise
from granulcal.loop.test.box import log_mass, marginal
from granulcal.loop.test.refit import fit_pair

Array = NDArray[np.float64]

SIZE, FINE = 12, 1501
SLOPES = np.random.default_rng(3).standard_normal((SIZE, 1))
ALONG = 4 * np.random.default_rng(5).standard_normal((SIZE, 2))
EFFECTS = (Effect("one"), Effect("other", is_two_sided=True))
COVARIANCE = np.eye(SIZE) + SLOPES @ SLOPES.T


class Linear:
    """A surrogate without error: m = A v + D psi, noise N(0, I)."""

    surrogate = SimpleNamespace(design=Design(("a",), ("c",), EFFECTS))
    nuisance = np.zeros((SIZE, SIZE))

    def none(self) -> Array:
        return np.zeros(2)

    def mean(self, v: Array, psi: Array) -> Array:
        return SLOPES @ v + ALONG @ psi

    def slopes(self, v: Array, psi: Array, active: tuple[int, ...]) -> tuple[Array, Array]:
        return self.mean(v, psi), np.column_stack([SLOPES, ALONG[:, list(active)]])

    def covariance(self, v: Array, psi: Array) -> Array:
        return np.eye(SIZE)

    pour_covariance = covariance

    def error_covariance(self, v: Array, psi: Array) -> Array:
        return np.zeros((SIZE, SIZE))


def posterior(target: Array) -> tuple[Array, Array, Array]:
    """Strengths, theta integrated in closed form: two axes of nodes and the log density there."""
    one, other = np.linspace(0, 1, FINE), np.linspace(-1, 1, FINE)
    root = np.linalg.cholesky(COVARIANCE)
    left, *along = np.linalg.solve(root, np.column_stack([target, ALONG])).T
    rest = left - one[:, None, None] * along[0] - other[:, None] * along[1]
    log_det = 2 * np.log(np.diag(root)).sum() + SIZE * np.log(2 * np.pi)
    return one, other, -0.5 * (np.sum(rest**2, axis=2) + log_det)


def log_integral(density: Array) -> float:
    """Log of the mean over the box, by the trapezoid rule."""
    weights = np.exp(density - density.max())
    for _ in range(2):
        weights = (weights[1:] + weights[:-1]).mean(axis=0) / 2
    return float(density.max() + np.log(weights))


@pytest.mark.parametrize("psi", [(0.5, 0.2), (0.5, -1.1), (1.3, 1.4), (-0.4, 0.3), (2.0, -2.0)])
def test_the_evidence_of_a_pair_is_the_integral_at_an_end_as_well(psi: tuple[float, ...]) -> None:
    local = cast(Any, Linear())
    noise = np.random.default_rng(4).standard_normal(SIZE)
    target = local.mean(np.array([0.5]), np.array(psi)) + noise
    base = summarise(local, target, np.zeros(1), np.zeros(2), ())
    found = fit_pair(local, target, base, base, (0, 1), Thresholds())
    one, other, density = posterior(target)
    # As if an end were a maximum it was up to 5 nat too high.
    assert found.log_evidence == pytest.approx(log_integral(density), abs=0.05)
    weights = np.exp(density - density.max())
    middle = [one @ weights.sum(axis=1), other @ weights.sum(axis=0)] / weights.sum()
    assert found.strengths == pytest.approx(middle, abs=0.01)
    shares = np.cumsum(weights.sum(axis=1)) / weights.sum()
    assert found.intervals[0] == pytest.approx(np.interp([0.025, 0.975], shares, one), abs=0.01)


@pytest.mark.parametrize("psi", [(0.5, 0.2), (1.3, 1.4), (2.0, -2.0), (8.0, 0.0)])
def test_own_pours_beyond_an_end_are_as_improbable_as_they_say(
    psi: tuple[float, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    local = Linear()
    target = local.mean(np.array([0.5]), np.array(psi))
    fit = SimpleNamespace(v=np.zeros(1), psi=np.zeros(2), active=(0, 1))
    monkeypatch.setattr(by_pours, "gap_of", lambda *_: (local, np.eye(SIZE), target))
    nothing: Any = None
    surrogate, model = cast(Any, local.surrogate), cast(Fit, fit)
    found = by_pours.log_evidence(surrogate, model, model, nothing, nothing)
    # Of 4,000 draws none in the box was -8.3 nat, whatever lay beyond.
    exact = log_integral(posterior(target)[2]) + 0.5 * SIZE * np.log(2 * np.pi)
    assert found == pytest.approx(exact, abs=0.05)


def test_the_mass_of_a_normal_in_a_box() -> None:
    low, wide = np.array([0.0, -1.0]), np.diag([1e4, 1e4])
    assert log_mass(np.zeros(2), wide, low) == pytest.approx(
        np.log(2 / (2 * np.pi * 1e4)), abs=1e-3
    )
    narrow = np.array([[1e-8, 9e-9], [9e-9, 1e-8]])
    assert log_mass(np.array([0.4, 0.1]), narrow, low) == pytest.approx(0, abs=1e-3)
    at, density = marginal(np.array([0.4, 0.1]), narrow, low, 0)
    assert at[density.argmax()] == pytest.approx(0.4, abs=1e-5)
    # Mills: forty standard deviations beyond.
    beyond = log_mass(np.array([1.4]), np.array([[1e-4]]), np.zeros(1))
    assert beyond == pytest.approx(-800 - np.log(40 * np.sqrt(2 * np.pi)), abs=1e-2)
