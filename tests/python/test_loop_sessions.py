"""Sessions: what each condition has of its own is one number in all of one session's."""

from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from granulcal.errors import ObservationError
from granulcal.loop.analysis import Analysis
from granulcal.loop.check.own_errors import as_recorded, in_told_sessions, with_own_errors
from granulcal.loop.condition import Condition
from granulcal.loop.effects.design import Design, Effect, normal_from_cube
from granulcal.loop.effects.library import by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.pours.replicates import ModelPours
from granulcal.loop.surrogate.condition_pours import ConditionPours, session_numbers
from granulcal.loop.surrogate.linearised import LinearisedSurrogate
from granulcal.loop.surrogate.surrogate import Surrogate
from granulcal.loop.task import FIT, SEALED, Task
from granulcal.loop.test.distance import noise_free_square
from granulcal.loop.test.thresholds import Thresholds
from granulcal.loop.test.trace import power, trace
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

Array = NDArray[np.float64]
RULES = Thresholds(replicates=400, replicates_after=200, refits=4)
THETA = np.array([0.4, 0.6])
SIZE = 6


@dataclass(frozen=True)
class Clocks:
    """x = A (2 u - 1) + clock D (1 + c) + noise: a clock moves all statistics alike."""

    slopes: Array
    clock: Array

    @classmethod
    def make(cls) -> "Clocks":
        generator = np.random.default_rng(3)
        return cls(3 * generator.standard_normal((2, SIZE)), generator.standard_normal(SIZE))

    def pours(self, theta: Array, c: Array, psi: Array, seed: int) -> Array:
        noise = 0.5 * np.random.default_rng([seed, 1]).standard_normal((len(theta), SIZE))
        return (2 * theta - 1) @ self.slopes + psi * (1 + c) * 3 * self.clock + noise

    def surrogate(self, *, is_shared: bool = False) -> Surrogate:
        generator = np.random.default_rng(4)
        count, own = 360, 80
        theta, c = generator.random((count, 2)), generator.random((count, 1))
        psi = np.zeros((count, 1))
        psi[-own:, 0] = generator.uniform(-1, 1, own)
        clock = Effect("clock", is_two_sided=True, nuisance_sd=0.5, is_shared=is_shared)
        design = Design(("a", "b"), ("height",), (clock,))
        return Surrogate.fit(design, theta, c, psi, self.pours(theta, c, psi, 0), features=8)

    def at(self, c: float, psi: float, seed: int, count: int = 5) -> Array:
        rows = np.tile(THETA, (count, 1)), np.full((count, 1), c), np.full((count, 1), psi)
        return self.pours(*rows, seed)


@pytest.fixture(scope="module")
def toy() -> Clocks:
    return Clocks.make()


@pytest.fixture(scope="module")
def surrogate(toy: Clocks) -> Surrogate:
    return toy.surrogate()


def test_a_session_without_a_name_is_its_own() -> None:
    numbers = session_numbers(["", "monday", "", "tuesday", "monday"])
    assert len(set(numbers.tolist())) == 4 and numbers[1] == numbers[4]


def test_one_value_holds_within_a_session(toy: Clocks, surrogate: Surrogate) -> None:
    at, counts, v = np.array([[0.0], [0.5], [1.0]]), np.ones(3), np.zeros(2)
    of = [LinearisedSurrogate.at(surrogate, at, counts, v, s) for s in (None, np.array([0, 1, 0]))]
    each, days = (local.nuisance.reshape(3, SIZE, 3, SIZE) for local in of)
    (along,) = of[0].own_errors
    for g in range(3):
        for h in range(3):
            product = np.outer(along[g], along[h])
            assert each[g, :, h] == pytest.approx(product if g == h else 0 * product)
            together = g == h or {g, h} == {0, 2}
            assert days[g, :, h] == pytest.approx(product if together else 0 * product)
    shared = LinearisedSurrogate.at(toy.surrogate(is_shared=True), at, counts, v)
    assert np.linalg.matrix_rank(shared.nuisance) == 1


def test_drawn_errors_are_of_the_declared_size(toy: Clocks, surrogate: Surrogate) -> None:
    days, places = ("monday", "", "monday"), (0.0, 0.5, 1.0)
    seen = [
        ConditionPours.of(f"{c:g}", [c], toy.at(c, 0.0, 1), day)
        for c, day in zip(places, days, strict=True)
    ]
    at, numbers = np.array(places)[:, None], session_numbers(days)
    v = normal_from_cube(THETA)
    gaps = []
    for i in range(400):
        moved = with_own_errors(surrogate, v, seen, np.random.default_rng(i))
        each = [
            surrogate.standardise(one.pours) - surrogate.standardise(plain.pours)
            for one, plain in zip(moved, seen, strict=True)
        ]
        # All pours of a condition have its clock.
        np.testing.assert_allclose(each, np.tile([rows[:1] for rows in each], (1, 5, 1)), atol=1e-9)
        gaps.append(np.concatenate([rows[0] for rows in each]))
    found = np.array(gaps).T @ np.array(gaps) / len(gaps)
    declared = LinearisedSurrogate.at(surrogate, at, np.full(3, 5.0), v, numbers).nuisance
    assert np.abs(found - declared).max() < 0.2 * np.abs(declared).max()


def test_two_clocks_of_one_day_are_a_finding(toy: Clocks, surrogate: Surrogate) -> None:
    # Late under one condition, early under the other: clocks of two days, but not of one.
    pours = [toy.at(0.0, 0.4, 1), toy.at(0.2, -0.4, 2)]

    def left(sessions: tuple[str, str]) -> float:
        each = zip(("low", "high"), (0.0, 0.2), pours, sessions, strict=True)
        observed = [ConditionPours.of(name, [c], x, day) for name, c, x, day in each]
        return trace(surrogate, observed, RULES).residual_test.p

    assert left(("", "")) == left(("monday", "tuesday")) > 0.05
    assert left(("monday", "monday")) < 0.01


def test_fewer_clocks_leave_more_to_be_seen(toy: Clocks) -> None:
    clock, effect = toy.surrogate().design.effects[0], Effect("force")
    generator = np.random.default_rng(8)
    theta, c = generator.random((400, 2)), generator.random((400, 1))
    psi = np.zeros((400, 2))
    psi[240:320, 0], psi[320:, 1] = generator.uniform(-1, 1, 80), generator.random(80)
    # The force does what a clock does, but for one condition to the other side.
    x = toy.pours(theta, c, psi[:, :1], 9) + psi[:, 1:] * (1 - 2 * c) * 3 * toy.clock
    design = Design(("a", "b"), ("height",), (clock, effect))
    both = Surrogate.fit(design, theta, c, psi, x, features=8)
    at, counts = [[0.0], [1.0]], [5, 5]
    own = power(both, THETA, at, counts)
    one = power(both, THETA, at, counts, np.array([0, 0]))
    assert one.detectable[0] < 0.5 * own.detectable[0]


def test_a_sealed_condition_is_read_by_the_clock_of_its_day(
    toy: Clocks, surrogate: Surrogate
) -> None:
    late = 0.7
    recordings = tuple(Path(str(i)) for i in range(5))
    conditions = (
        Condition("low", {"c": 0.0}, FIT, recordings, session="monday"),
        Condition("middle", {"c": 0.5}, FIT, recordings, session="monday"),
        Condition("high", {"c": 1.0}, SEALED, recordings, session="monday"),
        Condition("other day", {"c": 1.0}, SEALED, recordings, session="tuesday"),
    )

    def observed(rows: dict[str, ArrayLike]) -> list[ConditionPours]:
        fitted = [c for c in conditions if c.use == FIT]
        return [ConditionPours.of(c.name, [c.at["c"]], rows[c.name], c.session) for c in fitted]

    analysis = SimpleNamespace(
        fitted=conditions[:2],
        task=SimpleNamespace(
            conditions=conditions, of=lambda use: [c for c in conditions if c.use == use]
        ),
        plan=SimpleNamespace(unit=lambda at: np.array([at["c"]])),
        observed=observed,
    )
    measured = {c.name: toy.at(c.at["c"], late, 20 + i) for i, c in enumerate(conditions)}
    plain = {c.name: toy.at(c.at["c"], 0.0, 40 + i, 10) for i, c in enumerate(conditions)}
    simulated = {name: ModelPours(rows, rows) for name, rows in plain.items()}
    found = trace(surrogate, observed({c.name: measured[c.name] for c in conditions}), RULES)
    assert found.verdict.kind == "NONE"
    asked = cast(Analysis, analysis)
    read = as_recorded(asked, surrogate, found, measured, simulated)
    assert read["other day"].base is simulated["other day"].base

    def square(pours: dict[str, ModelPours], name: str) -> float:
        return noise_free_square(measured[name], pours[name].base, np.full(SIZE, 0.5))

    for name in ("low", "middle", "high"):
        assert square(read, name) < 0.05 * square(simulated, name)
    assert [c.name for c in in_told_sessions(asked.task)] == ["low", "middle", "high"]
    # Neither in sessions of their own nor with too few pours is anything told.
    unnamed = tuple(replace(c, session="") for c in conditions)
    nameless: Any = SimpleNamespace(
        **{**vars(analysis), "task": SimpleNamespace(conditions=unnamed, of=lambda _: unnamed[:2])}
    )
    assert as_recorded(nameless, surrogate, found, measured, simulated) is simulated
    few = simulated | {"low": ModelPours(plain["low"][:1], plain["low"][:1])}
    assert as_recorded(asked, surrogate, found, measured, few) is few


def test_a_session_that_says_nothing_is_refused() -> None:
    scene = Scene.drop(0.02, count=40)
    one = Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6)
    recordings = tuple(Path(name) for name in "abc")
    conditions = (Condition("all", {"start.height": 0.03}, FIT, recordings, session="monday"),)

    def task(table: dict[str, object]) -> Task:
        library = (*by_name(["drag"]), *declared_nuisances(table, scene))
        return Task(scene, Prior([one]), conditions, library)

    assert task({"tilt.x": {"sd": 0.005, "shared": False}}).conditions[0].session == "monday"
    with pytest.raises(ObservationError, match="session of all says nothing: .*shared = false"):
        task({"tilt.x": {"sd": 0.005, "shared": True}})


def test_a_task_file_states_sessions(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(Scene.drop(0.02, count=40).to_toml())
    one = Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6)
    (tmp_path / "prior.toml").write_text(Prior([one]).to_toml())
    for name in "abcd":
        (tmp_path / name).touch()
    (tmp_path / "loop.toml").write_text("""
scene = "scene.toml"
prior = "prior.toml"
effects = ["drag"]
nuisances = { "tilt.x" = { sd = 0.005, shared = false } }
[[conditions]]
name = "low"
at = { "start.height" = 0.03 }
use = "fit"
recordings = ["a", "b", "c"]
session = "monday"
[[conditions]]
name = "high"
at = { "start.height" = 0.05 }
use = "sealed"
recordings = ["d"]
""")
    task = Task.load(tmp_path / "loop.toml")
    assert [c.session for c in task.conditions] == ["monday", ""]
    assert [c.name for c in in_told_sessions(task)] == ["low"]
