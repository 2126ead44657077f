"""Rounds of simulations for one observation."""

from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

pytest.importorskip("torch")

import granulcal as gc
from granulcal.bayessim.check.toys import LinearGaussian
from granulcal.bayessim.training.sequential import infer_within_budget, round_sizes
from granulcal.engines import CallableEngine
from granulcal.errors import ObservationError, PriorError, TrainingDataError
from granulcal.parameter import Parameter
from granulcal.pours.kept_pours import KeptPours
from granulcal.pours.made_for import MadeFor
from granulcal.pours.scene import Scene
from granulcal.prior import Prior
from granulcal.within_budget import calibrate_within


@pytest.fixture(scope="module")
def toy():
    return LinearGaussian.random(seed=1, noise=1.0, bounded=True)


def test_a_budget_is_spent_where_the_posterior_is(toy):
    theta, x = toy.simulate(1, seed=3)
    asked = []

    def simulate(at, first):
        asked.append((first, at))
        made = toy.simulate_at(at, seed=first)
        # Some pours fail; they count.
        made[::10] = np.nan
        return made

    seen = []
    found = infer_within_budget(simulate, toy.prior, x[0], budget=100, progress=seen.append)
    assert [first for first, _ in asked] == [0, 40, 60, 80] and len(found.x) == 100
    assert seen == list(found.rounds) and seen[-1].usable == 90
    assert found.left_out.total == found.left_out.unseen == 10
    distance = [np.linalg.norm(at - theta, axis=1).mean() for _, at in asked]
    assert distance[-1] < 0.7 * distance[0]
    exact = toy.posterior(x[0])
    draws = exact.sample(500, seed=1)
    divergence = np.mean(exact.log_prob(draws) - found.posterior.log_prob(draws))
    prior = np.mean(exact.log_prob(draws)) - toy.prior.log_prob(draws).mean()
    assert divergence < 0.2 * prior
    assert "100 of 100 pours" in str(seen[-1])


def test_budgets_and_observations_are_checked(toy):
    assert sum(round_sizes(101)) == 101
    with pytest.raises(ValueError, match="at least 60"):
        round_sizes(39)
    x = toy.simulate(1)[1][0]
    with pytest.raises(ObservationError, match="finite"):
        infer_within_budget(lambda at, first: at, toy.prior, x * np.nan)
    with pytest.raises(ValueError, match="masked"):
        hidden = np.ma.masked_greater(x, x.min())
        infer_within_budget(lambda at, first: at, toy.prior, hidden)
    with pytest.raises(TypeError, match=r"prior must be a Prior, .*'prior\.toml'"):
        infer_within_budget(lambda at, first: at, cast(Any, "prior.toml"), x)
    with pytest.raises(TrainingDataError, match="0 of 40"):
        infer_within_budget(lambda at, first: np.full((len(at), 16), np.nan), toy.prior, x)


@pytest.mark.parametrize(
    ("path", "low", "high", "told"),
    [
        ("material.sliding_friction", 0.0, 10.5, "at the value 10.5: .* in .0, 10., got 10.5"),
        ("material.sliding", 0.0, 1.0, "at the value 0: .*does not name a number"),
    ],
)
def test_a_prior_that_does_not_fit_the_scene_is_refused_before_any_pour(
    path: str, low: float, high: float, told: str, tmp_path
):
    prior = Prior([Parameter(path=path, distribution="uniform", low=low, high=high)])
    never_read = cast(Any, [None])
    with pytest.raises(PriorError, match=f"prior of {path} does not fit the scene {told}"):
        calibrate_within(Scene.drop(0.02, count=20), prior, never_read, out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_too_few_usable_pours_are_told_by_why(tmp_path):
    """That nine in ten were unhealthy, for want of a finer step, had been told nowhere."""
    scene = Scene.drop(0.02, count=60, preset="fast")
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=150)
    depth = camera.render(*scene.start(1))
    recording = gc.Recording.from_depth(depth, fx=75.0, fy=75.0, cx=74.5, cy=74.5)

    def lossy(scene, seed):
        centres, radii = scene.start(seed)
        return (centres * np.nan if seed % 3 else centres), radii

    engine = gc.engines.CallableEngine(lossy, name="lossy")
    prior = Prior([Parameter(path="material.restitution", distribution="uniform", low=0, high=1)])
    with (
        pytest.warns(UserWarning),
        pytest.raises(
            TrainingDataError,
            match=r"(?s)20 pours must be usable, \d+ of 24 are.*Not usable: \d+ unhealthy; of "
            "unhealthy ones `granulcal simulate` says .* a finer `substep`",
        ),
    ):
        calibrate_within(scene, prior, [recording], budget=60, out=tmp_path, engine=engine)


def test_a_data_set_is_no_place_for_the_pours_of_recordings(tmp_path):
    scene, prior = Scene.drop(0.02, count=20), Prior.default()
    centres, radii = scene.start(1)
    camera = gc.Camera.overhead(height=0.29, field_width=0.58, pixels=150)
    depth = camera.render(centres, radii)
    recording = gc.Recording.from_depth(depth, fx=75.0, fy=75.0, cx=74.5, cy=74.5)
    (tmp_path / "manifest.toml").touch()
    with (
        pytest.warns(UserWarning),
        pytest.raises(ValueError, match="is a data set of `generate`.*give another folder"),
    ):
        calibrate_within(scene, prior, [recording], budget=60, out=tmp_path)
    assert [each.name for each in tmp_path.iterdir()] == ["manifest.toml"]


def test_pours_are_kept_and_never_made_twice(tmp_path):
    scene = Scene.drop(0.02, count=20)
    prior = Prior(
        [
            Parameter(path="material.sliding_friction", distribution="uniform", low=0.1, high=0.9),
            Parameter(path="material.restitution", distribution="fixed", value=0.3),
        ]
    )
    theta, counted = np.array([[0.2], [0.5], [0.8]]), []
    file = tmp_path / "pours.json"
    first = KeptPours(scene, prior, file, threads=1, progress=counted.append)(theta[:2], 0)
    again = KeptPours(scene, prior, file, threads=1, progress=counted.append)
    np.testing.assert_array_equal(again(theta, 0)[:2], first)
    left = sorted(path.name for path in tmp_path.iterdir())
    assert counted == [1, 2, 3] and left == [".pours.json.lock", "pours.json"]
    with pytest.raises(ValueError, match="another scene, prior or seed"):
        KeptPours(scene, prior, file, seed=1)
    with pytest.raises(ValueError, match="give another folder, or remove the file"):
        KeptPours(scene, prior, file, seed=1)
    file.write_text("{")
    with pytest.raises(ValueError, match="truncated or not JSON"):
        KeptPours(scene, prior, file)


def test_pours_of_which_not_all_is_seen_are_gone_on_with(tmp_path: Path) -> None:
    prior, file = Prior.default(), tmp_path / "pours.json"
    plain = Scene.drop(0.02, count=20).to_toml()
    scene = Scene.from_toml(
        f"{plain}\n[observe]\nrate = 10.0\n[observe.front]\ntimes = [0.1]\n"
        "[observe.radius]\npercentiles = [50.0]\n"
    )
    # Of another simulator the grains at rest are known, and no front on the way.
    still = CallableEngine(lambda scene, seed: scene.start(seed), name="not moved")
    theta, again = prior.sample(2, seed=1), []
    for _ in range(2):
        pours = KeptPours(scene, prior, file, threads=1, observed=True, engine=still)
        again.append((pours.kept_of(theta), pours(theta, 0)))
        seen = np.isfinite(again[-1][1]).all(axis=0)
        assert dict(zip(pours.x_names, seen, strict=True)) == {
            "front_radius[0.1]": False, "front_radius[end]": False, "radius[50]": True
        }  # fmt: skip
        assert pours.left_out(2).unseen == 2 and pours.left_out(2, ("radius[50]",)).total == 0
        del pours
    (first, made), (second, kept) = again
    assert (first, second) == (0, 2)
    np.testing.assert_array_equal(made, kept)


def test_a_folder_is_of_one_observation(tmp_path):
    scene, prior = Scene.drop(0.02, count=20), Prior.default()
    theta, file = prior.sample(2, seed=1), tmp_path / "pours.json"
    x = np.arange(32.0).reshape(2, 16)
    first = MadeFor.of(["a.png", "b.png"], x)
    made = KeptPours(scene, prior, file, threads=1, made_for=first)
    kept = made(theta, 0)
    del made
    # Moved, and in another order, they are the same; what asks without an observation keeps it.
    moved = MadeFor.of(["there/b.png", "there/a.png"], x[::-1] * (1 + 1e-9))
    for same in (moved, None):
        again = KeptPours(scene, prior, file, threads=1, made_for=same)
        np.testing.assert_array_equal(again(np.r_[theta, theta[:1]], 0)[:2], kept)
        del again
    others = {
        r"another recording, a\.png, b\.png": MadeFor.of(["c.png", "d.png"], x + 1e-3),
        "for another recording": MadeFor.of(["a.png"], x[:1]),
        "showed before it": MadeFor.of(["a.png", "b.png"], x + 1e-3),
    }
    before = file.read_bytes()
    for told, other in others.items():
        with pytest.raises(ValueError, match=f"{told}.* give another folder, or remove"):
            KeptPours(scene, prior, file, made_for=other)
    assert file.read_bytes() == before
