"""Recordings that differ from each other by more or less than pours do, and ends of a prior."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.loop.check.alarms import of_prior
from granulcal.loop.check.scatter import Scatter, of_scatter, scatter_of
from granulcal.loop.effects.design import Design, Effect
from granulcal.loop.surrogate.baseline import Fit, fit_base
from granulcal.loop.surrogate.condition_pours import ConditionPours
from granulcal.loop.surrogate.stacked_means import StackedMeans
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.verdict import Verdict
from granulcal.prior import Parameter, Prior

Array = NDArray[np.float64]

RULES = Thresholds()
SIZE, COUNT = 6, 5
MIXING = np.eye(SIZE) + 0.3 * np.random.default_rng(1).standard_normal((SIZE, SIZE))
SLOPES = 3 * np.random.default_rng(2).standard_normal((2, SIZE))


def simulate(theta: Array, generator: np.random.Generator, noise: float = 0.5) -> Array:
    """Statistics that are linear in two parameters, with noise that correlates."""
    scatter = generator.standard_normal((len(theta), SIZE)) @ MIXING.T
    return (2 * theta - 1) @ SLOPES + noise * scatter


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    generator = np.random.default_rng(3)
    theta, c, psi = generator.random((400, 2)), generator.random((400, 1)), np.zeros((400, 1))
    # An effect that does nothing.
    psi[-80:, 0] = generator.random(80)
    design = Design(("a", "b"), ("height",), (Effect("drag"),))
    return Surrogate.fit(design, theta, c, psi, simulate(theta, generator), features=8)


def seen(seed: int, noise: float, count: int = COUNT) -> list[ConditionPours]:
    """Pours of one material at three heights."""
    generator = np.random.default_rng(seed)
    rows = np.tile([0.4, 0.6], (count, 1))
    return [
        ConditionPours.of(f"{c:g}", [c], simulate(rows, generator, noise)) for c in (0.0, 0.5, 1.0)
    ]


def at_fit(surrogate: Surrogate, measured: list[ConditionPours]) -> Fit:
    return fit_base(surrogate, StackedMeans.of(surrogate, measured), 0)[1]


def test_recordings_that_scatter_as_pours_raise_no_doubt(surrogate: Surrogate) -> None:
    ratios, raised = [], 0
    for seed in range(40):
        measured = seen(seed, 0.5)
        found = scatter_of(surrogate, at_fit(surrogate, measured), measured, seed=seed)
        assert found is not None
        ratios.append(found.ratio)
        raised += bool(of_scatter(found, RULES))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)
    # One in a hundred is what the level says.
    assert raised <= 2


def test_recordings_with_a_noise_of_their_own_are_told(surrogate: Surrogate) -> None:
    measured = seen(7, 1.0)
    found = scatter_of(surrogate, at_fit(surrogate, measured), measured)
    assert found is not None and found.ratio == pytest.approx(2.0, rel=0.2)
    (told,) = of_scatter(found, RULES)
    assert "times what pours of the model do (p = 0.0005)" in told and "no more than that" in told


def test_recordings_of_one_pour_are_told(surrogate: Surrogate) -> None:
    measured = seen(7, 0.05)
    found = scatter_of(surrogate, at_fit(surrogate, measured), measured)
    assert found is not None and found.ratio == pytest.approx(0.1, rel=0.2)
    (told,) = of_scatter(found, RULES)
    assert "are several of them of one pour?" in told
    # What the surrogate cannot follow is in the draws, too.
    assert of_scatter(Scatter(0.75, 1.0, 0.0005), RULES) == ()


def test_single_recordings_do_not_differ(surrogate: Surrogate) -> None:
    measured = seen(7, 1.0, 1)
    assert scatter_of(surrogate, at_fit(surrogate, measured), measured) is None
    assert of_scatter(None, RULES) == ()


def test_a_base_fit_at_the_end_of_its_prior_is_told_beside_what_is_left() -> None:
    prior = Prior(
        [
            Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6),
            Parameter(path="material.sliding_friction", distribution="uniform", low=0.0, high=1.0),
        ]
    )
    task = cast(Any, SimpleNamespace(prior=prior))

    def told(kind: str, *theta: float) -> tuple[str, ...]:
        base = cast(Any, SimpleNamespace(theta=np.array(theta)))
        return of_prior(Verdict(kind, (), (), 0.001, ""), base, task)

    (one,) = told("UNEXPLAINED", 0.995, 0.5)
    assert "material.restitution = 0.598: either" in one and "friction" not in one
    assert "sliding_friction = 0.004" in told("EFFECT", 0.5, 0.004)[0]
    assert told("EFFECT", 0.98, 0.02) == told("NONE", 0.995, 0.5) == ()
