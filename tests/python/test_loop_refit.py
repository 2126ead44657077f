"""The evidence of an effect whose strength is known to a hundredth of its range."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop import Design, Effect, Thresholds
from granulcal.loop.surrogate.baseline import summarise
from granulcal.loop.test.refit import _cubic, fit_none, fit_single

Array = NDArray[np.float64]

SIZE = 12
SLOPES, ALONG = np.random.default_rng(3).standard_normal((2, SIZE, 2))


class Known:
    """A surrogate without error: m = A v + D f(psi), f bent, noise N(0, I)."""

    def __init__(self, steep: float, *, is_two_sided: bool) -> None:
        effects = (Effect("sharp", is_two_sided=is_two_sided),)
        self.surrogate = SimpleNamespace(design=Design(("a", "b"), ("c",), effects))
        self.steep, self.nuisance = steep, np.zeros((SIZE, SIZE))

    def none(self) -> Array:
        return np.zeros(1)

    def bent(self, psi: Array | float) -> Array:
        """Little at first, and more and more."""
        return self.steep * np.multiply.outer(np.sign(psi) * np.abs(psi) ** 3, ALONG[:, 0])

    def mean(self, v: Array, psi: Array) -> Array:
        return SLOPES @ v + self.bent(psi[0])

    def slopes(self, v: Array, psi: Array, active: tuple[int, ...]) -> tuple[Array, Array]:
        own = [3 * self.steep * psi[0] ** 2 * ALONG[:, 0] for _ in active]
        return self.mean(v, psi), np.column_stack([SLOPES, *own])

    def covariance(self, v: Array, psi: Array) -> Array:
        return np.eye(SIZE)

    pour_covariance = covariance

    def error_covariance(self, v: Array, psi: Array) -> Array:
        return np.zeros((SIZE, SIZE))

    def log_evidence(self, target: Array) -> float:
        """Theta in closed form, the strength by two hundred thousand nodes."""
        (effect,) = self.surrogate.design.effects
        psi = np.linspace(effect.low, 1.0, 200_001)
        covariance = np.eye(SIZE) + SLOPES @ SLOPES.T
        left = target - self.bent(psi)
        square = np.sum(left * np.linalg.solve(covariance, left.T).T, axis=1)
        log = -0.5 * (square + np.linalg.slogdet(2 * np.pi * covariance)[1])
        most = log.max()
        mass = np.sum(np.exp(log - most)) * (psi[1] - psi[0])
        return float(most + np.log(mass / (1 - effect.low)))


@pytest.mark.parametrize("steep", [3.0, 300.0, 3000.0])
@pytest.mark.parametrize("psi", [0.0, 0.1, 0.31, 0.8])
@pytest.mark.parametrize("is_two_sided", [False, True])
def test_the_evidence_is_the_integral(steep: float, psi: float, is_two_sided: bool) -> None:
    known = Known(steep, is_two_sided=is_two_sided)
    local = cast(Any, known)
    noise = np.random.default_rng(4).standard_normal(SIZE)
    target = known.mean(np.array([0.5, -1.0]), np.array([psi])) + noise
    v = np.linalg.solve(SLOPES.T @ SLOPES + np.eye(2), SLOPES.T @ target)
    base = summarise(local, target, v, np.zeros(1), ())
    rules = Thresholds()
    found = fit_single(local, target, base, 0, rules)
    # An overshoot between nodes was worth twenty nat and more.
    assert found.log_evidence == pytest.approx(known.log_evidence(target), abs=0.3)
    low, high = found.intervals[0]
    assert low - 0.02 <= psi <= high + 0.02
    left = target - SLOPES @ v
    assert fit_none(base, rules).log_evidence == pytest.approx(
        -0.5 * (left @ left + v @ v)
        - 0.5 * np.linalg.slogdet(SLOPES.T @ SLOPES + np.eye(2))[1]
        - 0.5 * SIZE * np.log(2 * np.pi)
    )


def test_between_nodes_nothing_is_beyond_them() -> None:
    # The log density of a camera's blur, seen through an offset of -0.2 mm.
    x = np.array([0.0, 0.0625, 0.125, 0.1875, 0.25])
    y = np.array([-16.2, -16.6, -1.8, -344.2, -1411.5])
    at = np.linspace(0, 0.25, 501)
    found = _cubic(x, y, at)
    i = np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2)
    low, high = np.minimum(y[i], y[i + 1]), np.maximum(y[i], y[i + 1])
    assert (found >= low - 1e-9).all() and (found <= high + 1e-9).all()
    np.testing.assert_allclose(_cubic(x, y, x), y)
    uneven = np.array([0.0, 0.1, 0.4, 1.0])
    np.testing.assert_allclose(_cubic(uneven, 2 * uneven - 1, at), 2 * at - 1, atol=1e-12)
