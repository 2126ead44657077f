"""Grains of two sizes in the archive, the limit in the model."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from granulcal.errors import ObservationError
from granulcal.loop import ConditionPours, Design, Effect, Surrogate, Thresholds, trace
from granulcal.loop.effects.resolution import Resolution
from granulcal.loop.pours.archive import Archive, ArchivePlan
from granulcal.loop.pours.forward import Coarse, Forward
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

Array = NDArray[np.float64]

SIZE = 5
HELD = -0.7
RULES = Thresholds(replicates=400, replicates_after=200, refits=4)
DESIGN = Design(
    ("a",), ("c",), (Effect("resolution", held=HELD), Effect("tilt", is_two_sided=True))
)


def pours(theta: Array, condition: Array, psi: Array, generator: np.random.Generator) -> Array:
    """Five statistics, linear in everything; the size moves the last two as theta moves none."""
    slopes = np.array([1.0, -0.5, 0.7, 0.2, 0.0])
    size = np.array([0.2, 0.0, 0.1, 1.0, -0.8]) * (1 + 0.5 * condition)
    tilt = np.array([0.0, 0.6, -0.6, 0.5, 0.6])
    mean = theta * slopes + condition * np.linspace(0.2, 1.0, SIZE)
    mean = mean + psi[:, :1] * size + psi[:, 1:] * tilt
    return mean + 0.1 * generator.standard_normal((len(theta), SIZE))


@pytest.fixture(scope="module")
def surrogate() -> Surrogate:
    """Base pours at the fine size, coarse ones at psi = 1, tilted ones."""
    generator = np.random.default_rng(0)
    base, each = 240, 80
    theta, condition = (
        generator.random((base + 2 * each, 1)),
        generator.random((base + 2 * each, 1)),
    )
    psi = np.zeros((base + 2 * each, 2))
    psi[base : base + each, 0] = 1.0
    psi[base + each :, 1] = generator.uniform(-1, 1, each)
    x = pours(theta, condition, psi, generator)
    return Surrogate.fit(DESIGN, theta, condition, psi, x, features=8)


def observe(seed: int, *, size: float, tilt: float) -> list[ConditionPours]:
    generator = np.random.default_rng(seed)
    rows = []
    for c in (0.0, 0.5, 1.0):
        at = np.full((4, 1), c)
        psi = np.tile([size, tilt], (4, 1))
        rows.append(
            ConditionPours.of(f"{c:g}", [c], pours(np.full((4, 1), 0.4), at, psi, generator))
        )
    return rows


def test_real_grains_are_no_finding_and_the_archives_size_would_be(surrogate: Surrogate) -> None:
    assert DESIGN.candidates == (1,) and DESIGN.none().tolist() == [HELD, 0.0]
    alarms = 0
    for seed in range(8):
        found = trace(surrogate, observe(seed, size=HELD, tilt=0.0), RULES, seed=seed)
        alarms += found.residual_test.p <= 0.05
        assert found.base_fit.psi.tolist() == [HELD, 0.0]
        assert abs(float(found.base.theta[0]) - 0.4) < 0.25
    assert alarms <= 2
    # Read against the limit, pours of the archive's own size are something that is left.
    assert trace(surrogate, observe(1, size=0.0, tilt=0.0), RULES).residual_test.p <= 0.05


def test_an_effect_is_named_at_the_limit(surrogate: Surrogate) -> None:
    found = trace(surrogate, observe(3, size=HELD, tilt=0.8), RULES)
    assert found.verdict.named == ("tilt",)
    assert found.best.effects == ("tilt",) and found.best.strengths[0] == pytest.approx(
        0.8, abs=0.2
    )
    assert found.fit_of(found.best).psi[0] == HELD


def test_the_mean_is_linear_in_the_size_and_its_error_grows(surrogate: Surrogate) -> None:
    theta, condition = np.full((1, 1), 0.5), np.full((1, 1), 0.5)

    def mean(size: float) -> Array:
        return surrogate.mean(theta, condition, np.array([[size, 0.0]]))[0]

    assert mean(-0.7) == pytest.approx(mean(0.0) - 0.7 * (mean(1.0) - mean(0.0)))
    features = surrogate.features(theta, condition, np.array([[HELD, 0.0]]))[0]
    plain = surrogate.features(theta, condition, np.zeros((1, 2)))[0]
    wide, narrow = (
        [float(np.sum((f @ root) ** 2)) for root in surrogate.roots] for f in (features, plain)
    )
    assert np.mean(wide) > np.mean(narrow)


def drop() -> Scene:
    return Scene.drop(0.02, count=64).with_(preset="fast")


def test_sizes_are_numbers_of_the_scene() -> None:
    scene = drop()
    own = scene.get("grains.diameter")
    sizes = Resolution(diameter=own / 2, coarse=2 * own, scales={"grains.density": 0.0})
    assert sizes.held(scene) == pytest.approx(-0.5)
    numbers = sizes.numbers(scene)
    assert numbers["grains.count"] == 8 and numbers["grains.diameter"] == 2 * own
    effect = sizes.effect(scene)
    assert effect.numbers(1.0) == numbers and effect.numbers(0.0) == {}
    assert effect.design().held == pytest.approx(-0.5)
    with pytest.raises(ObservationError, match="needs diameter < the scene's"):
        Resolution(diameter=2 * own, coarse=4 * own).held(scene)
    with pytest.raises(ObservationError, match=r"\[resolution\] lacks \['coarse'\]"):
        Resolution.of({"diameter": 1e-3})


def test_the_number_of_grains_follows_a_volume_that_is_stated() -> None:
    text = drop().to_toml()
    (count,) = (line for line in text.splitlines() if line.startswith("count = "))
    own = drop().get("grains.diameter")
    scene = Scene.from_toml(text.replace(count, f"volume = {64 * np.pi / 6 * own**3!r}"))
    assert scene.get("grains.count") == 64
    numbers = Resolution(diameter=own / 2, coarse=2 * own).numbers(scene)
    assert "grains.count" not in numbers and scene.with_(numbers).get("grains.count") == 8
    # Also where the volume is another than the scene's, as in a fit that has it free.
    more = scene.with_({"grains.volume": 2 * scene.get("grains.volume")})
    assert more.with_(numbers).get("grains.count") == 16


def test_an_archive_has_both_sizes_and_forward_pours_their_limit(tmp_path: Path) -> None:
    scene = drop()
    own = scene.get("grains.diameter")
    sizes = Resolution(diameter=0.75 * own, coarse=1.5 * own)
    one = Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6)
    plan = ArchivePlan(
        scene=scene,
        prior=Prior([one]),
        conditions=(),
        library=(sizes.effect(scene),),
        base=8,
        each=4,
    )
    store = Archive(tmp_path / "archive", plan)
    store.fill(threads=1, say=lambda _: None, progress=False)
    rows = store.pours()
    assert sorted(set(rows.psi[:, 0])) == [0.0, 1.0] and (rows.psi == 1).sum() <= 4
    coarse = Coarse(sizes.numbers(scene), sizes.held(scene))
    # (1 + 1/2)^2 + (1/2)^2 = 2.5: three pours at each size make one that scatters no more.
    assert coarse.held == pytest.approx(-0.5) and coarse.repeats == 3
    forward = Forward(tmp_path / "pours", 1)
    found = forward.limit(scene, [1, 2], None, coarse)
    seeds = [s + 1_000_000_007 * i for s in (1, 2) for i in range(3)]
    fine, other = (
        forward.pours(s, seeds).reshape(2, 3, -1).mean(axis=1)
        for s in (scene, scene.with_(coarse.numbers))
    )
    assert found == pytest.approx(1.5 * fine - 0.5 * other)
    assert np.array_equal(forward.limit(scene, [1]), forward.pours(scene, [1]))
