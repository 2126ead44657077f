"""Conditions whose numbers hang together, recordings that are means, how they are read."""

import re
import struct
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

import granulcal as gc
from granulcal.errors import ObservationError, TrainingDataError
from granulcal.experiments import (
    _groups,
    loop_centrifuge,
    loop_column,
    loop_drum,
    loop_liquid,
    loop_mounds,
    loop_rings,
    loop_tube,
)
from granulcal.loop.close import Closed, _candidates, planned
from granulcal.loop.effects.design import Design, Effect, normal_from_cube
from granulcal.loop.effects.library import LibraryEffect, by_name
from granulcal.loop.pours.archive import Archive, ArchivePlan
from granulcal.loop.pours.cube import cube, from_cube
from granulcal.loop.pours.parts import parts_of
from granulcal.loop.surrogate.baseline import Fit
from granulcal.loop.surrogate.fit_draws import draw
from granulcal.loop.task import FIT, SEALED, Condition, Task
from granulcal.loop.test.thresholds import Thresholds

SCENE = """
name = "small"
[grains]
count = 60
diameter = 4e-3
density = 1300.0
[start]
kind = "ball"
height = 0.02
solid_fraction = 0.6
jitter = 5e-5
[end]
horizon = 1.0
[camera]
projection = "orthographic"
field_width = 0.2
pixels = 60
downsample = 1
height_threshold = 1e-3
"""
PRIOR = """
[[parameter]]
path = "material.sliding_friction"
distribution = "uniform"
low = 0.3
high = 0.8
"""
# Two numbers that move together.
LOW = {"start.height": 0.02, "end.horizon": 1.0, "grains.density": 1300.0}
HIGH = {"start.height": 0.05, "end.horizon": 1.2, "grains.density": 1300.0}


def task(between: bool, *, averaged: bool = False, effects: tuple[str, ...] = ("tilt.y",)) -> Task:
    low, high = (Path("a.npz"),), (Path("b.npz"),)
    return Task(
        gc.Scene.from_toml(SCENE),
        gc.Prior.from_toml(PRIOR),
        (
            Condition("low", LOW, FIT, low, averaged=averaged),
            Condition("high", HIGH, FIT, high, averaged=averaged),
        ),
        by_name(effects),
        between=between,
    )


def test_fewer_than_three_pours_are_refused_unless_each_is_a_mean_over_time() -> None:
    with pytest.raises(ObservationError, match="at least 3 pours .* got 2 .*averaged = true"):
        task(True)
    assert len(task(True, averaged=True).conditions) == 2
    sealed = Condition("low", LOW, SEALED, (Path("a.npz"),), averaged=True)
    with pytest.raises(ObservationError, match="got 0"):
        Task(gc.Scene.from_toml(SCENE), gc.Prior.from_toml(PRIOR), (sealed,), by_name([]))


def test_pours_at_the_conditions_alone_have_all_their_numbers() -> None:
    between, places = task(True, averaged=True), task(False, averaged=True)
    assert [path for path, _, _ in between.inputs] == ["start.height", "end.horizon"]
    assert between.places == ()
    # One number tells two conditions apart; the other goes with it.
    assert places.inputs == (("start.height", 0.02, 0.05),)
    assert places.places == tuple(
        {path: at[path] for path in ("start.height", "end.horizon")} for at in (LOW, HIGH)
    )
    plan = planned(places, 420, 0)
    assert plan.places == places.places and plan.conditions == places.inputs
    assert (plan.base, plan.each) == (300, 78)


@pytest.mark.parametrize("names", [(), ("camera.offset",), ("tilt.x", "camera.offset")])
def test_the_budget_that_is_said_to_be_enough_is(names: tuple[str, ...]) -> None:
    asked = task(False, averaged=True, effects=names)
    with pytest.raises(ObservationError, match=f"{len(names)} effects, ") as told:
        planned(asked, 10, 0)
    found = re.search(r"(\d+) would be enough", str(told.value))
    assert found and planned(asked, int(found[1]), 0).base >= 300
    with pytest.raises(ObservationError, match="would be enough"):
        planned(asked, int(found[1]) - 1, 0)


def test_an_archive_may_leave_sealed_conditions_out(tmp_path: Path) -> None:
    scene, prior = gc.Scene.from_toml(SCENE), gc.Prior.from_toml(PRIOR)
    for name in "abc":
        (tmp_path / name).touch()
    conditions = (
        Condition("low", LOW, FIT, tuple(tmp_path / name for name in "ab"), averaged=True),
        Condition("high", HIGH, SEALED, (tmp_path / "c",), averaged=True),
    )

    def asked(between: bool) -> Task:
        return Task(scene, prior, conditions, (), between=between, sealed_in_archive=False)

    (place,) = asked(False).places
    assert place == {path: LOW[path] for path in ("start.height", "end.horizon")}
    # A sealed condition still has its place in the coordinates.
    assert planned(asked(False), 400, 0).unit(HIGH) == pytest.approx([1.0])
    with pytest.raises(ObservationError, match="needs between = false"):
        asked(True)


def test_no_two_parts_share_their_seeds() -> None:
    # Steps of effects and of places met at eleven places: two pours would have passed for one.
    plan = planned(task(False, averaged=True, effects=("count", "tilt.x")), 900, 3)
    many = replace(plan, places=tuple({"start.height": 0.02 + 1e-3 * i} for i in range(31)))
    seeds = [part.seed for part in parts_of(many)]
    assert len(set(seeds)) == len(seeds) == 31 * (1 + 4 + 1)
    # Of a longer library the shorter one's parts keep theirs.
    longer = replace(many, library=(*many.library, *by_name(["drag"])))
    own = {part.name: part.seed for part in parts_of(longer)}
    assert [own[part.name] for part in parts_of(many)] == seeds


def test_an_archive_at_the_conditions_alone(tmp_path: Path) -> None:
    asked = task(False, averaged=True, effects=("tilt.y", "count"))
    plan = ArchivePlan(
        # Three quarters of 62 grains are 46.5, and 46 are more than the whole effect.
        scene=asked.at_first().with_({"grains.count": 62}),
        prior=asked.prior,
        conditions=asked.inputs,
        library=asked.library,
        base=6,
        each=8,
        places=asked.places,
    )
    archive = Archive(tmp_path / "archive", plan)
    archive.fill(threads=1, say=lambda _: None, progress=False)
    folders = sorted(p.name for p in (tmp_path / "archive").iterdir() if p.is_dir())
    assert folders[:2] == ["base-at-0", "base-at-1"] and "effect-count-3-at-1" in folders
    for number, at in enumerate((LOW, HIGH)):
        there = gc.Dataset.load(tmp_path / "archive" / f"base-at-{number}").scene
        assert all(there.get(path) == value for path, value in at.items())
    pours = archive.pours()
    assert len(pours.x) + pours.left_out.total == 6 + 8 + 8
    # Base pours first, those of both places.
    assert np.all(pours.psi[:6] == 0)
    assert sorted(pours.condition[:6, 0].tolist()) == [0, 0, 0, 1, 1, 1]
    assert set(pours.condition[:, 0].tolist()) == {0.0, 1.0}
    # No pour of one place is one of the other.
    assert len(np.unique(pours.theta[:6])) == 6
    design = plan.design
    design.check(pours.theta, pours.condition, pours.psi)
    strengths = np.unique(pours.psi[:, 1])
    assert strengths == pytest.approx([0, 0.25, 0.5, 0.75, 1.0], abs=0.04)
    # The same conditions with pours between them are another archive, and the other way round.
    with pytest.raises(TrainingDataError, match="is of another places"):
        Archive(tmp_path / "archive", ArchivePlan(**{**plan.__dict__, "places": ()}))


def test_how_a_recording_is_read_is_the_tasks_to_say(tmp_path: Path) -> None:
    # A mound of 12 mm on a flat bed, and a frame of 5 pixels that is a fault.
    edge = np.linspace(-1, 1, 60)
    mound = 0.012 * np.maximum(0.0, 1 - 9 * (edge[:, None] ** 2 + edge[None] ** 2))
    mound[:5], mound[-5:], mound[:, :5], mound[:, -5:] = 0.02, 0.02, 0.02, 0.02
    path = tmp_path / "map.npz"
    np.savez(path, depthmap=1e3 * mound, xres=3.4, yres=3.4, zres=1.0, scale="mm")
    scene = gc.Scene.from_toml(SCENE).with_({"grains.count": 400})

    def largest(**reading: float) -> float:
        one = Condition("map", {}, FIT, (path,), reading=reading)
        return float(one.statistics(scene)[0, 0])

    assert largest(border_px=6, height_threshold=1e-3) == pytest.approx(0.012, rel=0.05)
    # The faults are no grains of this scene.
    with pytest.raises(ObservationError, match="times that: is the recording of this scene"):
        largest()


def test_the_drums_walls_turn_together_and_its_effects_fit_the_scene(tmp_path: Path) -> None:
    # Pictures stand where the measured ones would; what they show does not matter here.
    folder = tmp_path / "granudrum-mcc"
    folder.mkdir()
    for rpm in (15, 45):
        (folder / f"gd_nature_{rpm}rpm_averaged.bmp").write_bytes(struct.pack("<2s", b"BM"))
    asked = loop_drum.task(tmp_path, (15,))
    assert [c.use for c in asked.conditions] == [FIT, SEALED]
    assert [path for path, _, _ in asked.inputs] == ["walls.0.motion.rate", "observe.surface.level"]
    slow, fast = asked.places
    assert slow["walls.0.motion.rate"] == slow["walls.1.motion.rate"] == pytest.approx(np.pi / 2)
    assert fast["walls.1.motion.rate"] == pytest.approx(3 * np.pi / 2)
    scene = asked.at_first()
    named = [effect.name for effect in asked.library if not effect.nuisance_sd and not effect.held]
    assert named == ["cohesion.capillary", "cohesion.dry"]
    assert asked.coarse is not None and asked.coarse.held == pytest.approx(-5 / 7)
    assert asked.coarse.numbers["start.spacing"] == pytest.approx(1.85e-3 * 2.4 / 1.7)
    # Equal volume, at the ends of the fill that every fit has free.
    (fill,) = (one for one in asked.prior.parameters if one.path == "grains.volume")
    assert fill.low is not None and fill.high is not None
    for volume in (fill.low, fill.high):
        filled = scene.with_({"grains.volume": volume})
        of_coarse = filled.with_(asked.coarse.numbers)
        for sized, diameter in ((filled, 1.7e-3), (of_coarse, 2.4e-3)):
            expected = volume / (np.pi / 6 * diameter**3)
            assert sized.get("grains.count") == pytest.approx(expected, abs=0.51)
    for entry in asked.library:
        effect = entry.at(scene)
        if effect.is_free or effect.held is not None:
            continue
        changed = scene.with_(effect.numbers(1.0))
        assert changed.get(effect.path) == effect.value(1.0)
        assert effect.strength(np.array([effect.value(0.5)]))[0] == pytest.approx(0.5, abs=1e-3)


def test_the_columns_are_read_by_their_outline_and_their_own_errors_have_no_name(
    tmp_path: Path,
) -> None:
    asked = loop_column.task(tmp_path)
    assert [path for path, _, _ in asked.inputs] == ["gravity.2", "observe.front.link"]
    assert asked.at_first().get("observe.front.link") == 1.5
    assert asked.places == ({"gravity.2": -9.81},)
    # What might be poured next is where the archive is, observed as the verdict is.
    ((label, at),) = _candidates(planned(asked, 996, 0, rounds=1, rules=Thresholds()))
    assert label == "gravity.2 = -9.81" and at == pytest.approx([1.0, 0.375])
    (one, *_) = asked.under(asked.definitions[3], FIT)
    assert one.reading == {"camera": 1} and one.at["observe.front.link"] == 1.5
    named = {effect.name for effect in asked.library if not effect.nuisance_sd}
    assert {"tension.capillary", "tension.dry", "fluid.saturated"} <= named
    assert not {"clock.offset", "clock.scale", "length.scale"} & named
    scene = asked.at_first()
    for entry in asked.library:
        if not entry.is_free:
            assert scene.with_(entry.at(scene).numbers(1.0)).get(entry.path) == entry.full


TESTS = """TestCode N rpm G r_0 d_p rho_p IF C_v rho_f mu_f
20210804_08g_050g_050_050_005 4.6 47 45.2 0.054 0.008 2632 g 0.404 1120 0.005
20220411_08g_500g_050_050_005 4.6 47 45.2 0.054 0.008 2632 g 0.742 1204 0.052
20220411_08g_1500g_050_050_005 4.6 47 45.2 0.054 0.008 2632 g 0.847 1228 0.157
20220411_08g_1000g_050_050_005 4.6 47 45.2 0.054 0.008 2632 g 0.812 1220 0.105
20211124_08g_010w_050_050_005 4.6 47 45.2 0.054 0.008 2632 w 0 1000 0.001
20211124_08g_010k_050_050_005 4.6 47 45.2 0.054 0.008 2632 k 0.04 1165 0.0167
20211126_08g_020k_050_050_005 4.6 47 45.2 0.054 0.008 2632 k 0.086 1330 0.0617
"""


def test_columns_in_the_centrifuge_hold_each_their_own_liquid_and_have_no_end(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "column-collapse-webb"
    folder.mkdir()
    (folder / "Experimental_Conditions.txt").write_text(TESTS)
    asked = loop_centrifuge.task(tmp_path)
    scene = asked.at_first()
    assert scene.get("gravity.2") == -45.2 and scene.get("effects.fluid.saturated") == 1.0
    # What is looked for is off, and what the liquid is known to be is no unknown.
    assert scene.get("effects.lubrication.shear") == 0.0
    assert not any(name.startswith("effects.") for name in asked.prior.names)
    assert len(asked.places) == 3 and [len(c.recordings) for c in asked.conditions[3:]] == [
        1,
        1,
        2,
        2,
    ]
    # In clay's films is its water with what is left of the clay at any rate.
    clay = asked.conditions[6].at
    assert clay["effects.lubrication.viscosity"] == pytest.approx(1e-3 * (1 + 2.5 * 0.086))
    assert clay["effects.fluid.viscosity"] == 0.0617
    times = [float(name[len("front_radius[") : -1]) for name in scene.observed_names]
    assert len(times) == 9 and scene.get("end.horizon") > scene.get("observe.begin") + times[-1]
    for entry in asked.library:
        if not entry.is_free:
            assert scene.with_(entry.at(scene).numbers(1.0)).get(entry.path) == entry.full
    [kind] = loop_centrifuge.poured(tmp_path)
    assert planned(asked, kind.count, 0, rounds=1, rules=Thresholds()).pours < kind.count


def test_columns_of_all_gravities_are_one_in_units_of_free_fall(tmp_path: Path) -> None:
    folder = tmp_path / "column-collapse-webb"
    folder.mkdir()
    codes = [
        code
        for group in (loop_liquid.FITTED, loop_liquid.SEALED_TESTS)
        for _, c in group
        for code in c
    ]
    names = "TestCode N G r_0 H_p0 H_f0 d_p rho_p phi_p IF C_v rho_f mu_f sigma_f"
    lines = [names]
    for code in codes:
        gravity = 4.0 if code.endswith("005") else 1.0
        fluid = code.partition("_08g_")[2][3]
        numbers = f"{gravity} {9.81 * gravity} 0.054 0.05 0.05 0.008 2632 0.6"
        lines.append(f"{code} {numbers} {fluid} 0.08 1100 0.02 0.06")
    (folder / "Experimental_Conditions.txt").write_text("\n".join(lines))
    asked = loop_liquid.task(tmp_path)
    scene = asked.at_first()
    assert scene.get("gravity.2") == -9.81 and scene.get("effects.lubrication.shear") == 0.0
    conditions = {condition.name: condition for condition in asked.conditions}
    slow, fast = conditions["73 % glycerol, 1 g"], conditions["78 % glycerol, 4.6 g"]
    assert slow.reading == {"fps": 240.0} and fast.reading == {"fps": 120.0}
    for path, ratio in (("viscosity", 2.0), ("tension", 4.0), ("density", 1.0)):
        name = f"effects.liquid.{path}"
        assert slow.at[name] == pytest.approx(ratio * fast.at[name])
    kinds = [name.partition("[")[0] for name in scene.observed_names]
    assert kinds == ["front_radius"] * 7 + ["liquid_radius"] * 7
    # A column of stated numbers is seen to run out, and its liquid ahead of it.
    pour = gc.simulate(scene, seed=1).observed()
    assert pour["liquid_radius[0.15]"] > pour["front_radius[0.15]"] > 0.06
    for entry in asked.library:
        if not entry.is_free:
            assert scene.with_(entry.at(scene).numbers(1.0)).get(entry.path) == entry.full
    # With a tube of each test's own its speed is an own error of a condition, and no unknown.
    own = loop_tube.task(tmp_path)
    assert set(asked.prior.names) - set(own.prior.names) == {"walls.0.motion.velocity.2"}
    [speed] = [entry for entry in own.library if entry.path == "walls.0.motion.velocity.2"]
    assert not speed.is_shared and speed.nuisance_sd == 0.5
    assert [entry.name for entry in own.library if entry is not speed] == [
        entry.name for entry in asked.library
    ]
    [kind] = loop_liquid.poured(tmp_path)
    assert planned(asked, kind.count, 0, rounds=1, rules=Thresholds()).pours < kind.count


@pytest.mark.parametrize("ends", [{}, {"low": 0.4}, {"high": 0.55}, {"low": 0.4, "high": 0.6}])
def test_coordinates_of_a_prior_are_shares_of_it(ends: dict[str, float]) -> None:
    # A model is poured at the parameters of its coordinates: those that pours of it would have.
    friction = gc.Parameter(
        path="material.sliding_friction", distribution="normal", mean=0.5, sd=0.2, **ends
    )
    rolling = gc.Parameter(
        path="material.rolling_friction", distribution="log_uniform", low=0.01, high=1.0
    )
    prior = gc.Prior([friction, rolling])
    theta = prior.sample(2000, seed=1)
    u = cube(prior, theta)
    np.testing.assert_allclose(from_cube(prior, u), theta, rtol=1e-9)
    assert np.abs(np.sort(u, axis=0) - (np.arange(2000) + 0.5)[:, None] / 2000).max() < 0.04


def test_draws_around_a_fit_have_its_spread_and_stay_in_the_prior() -> None:
    design = Design(("a", "b"), (), (Effect("up"), Effect("both", is_two_sided=True)))
    # Two parameters and one strength: slopes 3 and 0 in theta, and 4 in the strength.
    slopes = np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 4.0]])
    fit = Fit(np.zeros(2), np.array([0.9, 0.0]), (0,), np.zeros(3), slopes, np.eye(3), 0.0, 0.0)
    theta, psi = draw(fit, design, 4000, seed=1)
    assert theta.shape == (4000, 2) and psi.shape == (4000, 1)
    # With the prior's one: 1 / sqrt(10); what says nothing keeps the prior, uniform here.
    assert normal_from_cube(theta[:, 0]).std() == pytest.approx(10**-0.5, rel=0.05)
    assert theta[:, 1].std() == pytest.approx(12**-0.5, rel=0.05)
    assert psi.max() == 1.0 and psi.min() >= 0.0
    assert np.quantile(psi, 0.16) == pytest.approx(0.9 - 0.25, abs=0.02)


def test_the_rings_effects_fit_their_scene_and_no_map_is_fitted_and_sealed(tmp_path: Path) -> None:
    used = [n for fitted, sealed in loop_rings.GROUPS.values() for n in (*fitted, *sealed)]
    assert len(used) == len(set(used))
    # Rings that leave the picture are not among them.
    assert not {28, 29, 31, 35} & set(used)
    asked = loop_rings.task(tmp_path, "middle")
    assert asked.inputs == () and [len(c.recordings) for c in asked.conditions] == [4, 1, 1]
    scene = asked.at_first()
    for entry in asked.library:
        effect = entry.at(scene)
        for path, value in effect.numbers(1.0).items():
            assert scene.with_({path: value}).get(path) == value


def test_every_mound_is_in_one_group_and_every_other_one_is_sealed(tmp_path: Path) -> None:
    used = [n for fitted, sealed in loop_mounds.GROUPS.values() for n in (*fitted, *sealed)]
    # Every third map is not in the folder.
    assert sorted(used) == [n for n in range(1, 24) if n % 3]
    for fitted, sealed in loop_mounds.GROUPS.values():
        assert len(fitted) == len(sealed) and sorted((*fitted, *sealed))[::2] == list(fitted)
    scene = loop_mounds.task(tmp_path, "late").at_first()
    for effect in (entry.at(scene) for entry in loop_mounds.EFFECTS):
        for path, value in effect.numbers(1.0).items():
            assert scene.with_({path: value}).get(path) == value
    bed = next(entry for entry in loop_mounds.EFFECTS if entry.name == "ground.rolling")
    assert bed.at(scene).numbers(-1.0) == {"effects.ground.rolling_friction": 10.0}


def test_clods_of_maps_are_held_against_the_range_of_pours(tmp_path: Path, monkeypatch) -> None:
    shapes = {"a": (5.0, 2e-3, 0.4), "b": (9.0, 1e-3, 0.5)}
    monkeypatch.setattr(loop_mounds, "shape_of_pour", lambda pour: np.array(pour))
    monkeypatch.setattr(loop_mounds, "shape_of_map", lambda name, _: np.array(shapes[name]))
    monkeypatch.setattr(loop_mounds.Recording, "open", lambda path: path.stem)
    maps = {use: [Condition(n, {}, use, (tmp_path / n,))] for n, use in (("a", FIT), ("b", SEALED))}
    closed = SimpleNamespace(task=SimpleNamespace(of=maps.get, scene=None))
    pours = [(4.0, 1.5e-3, 0.45), (6.0, 2.5e-3, 0.55)]
    lines = loop_mounds._clods(cast(Closed, closed), cast(list[gc.Pour], pours))
    assert lines[2:] == [
        "| pours at the fit | 4 to 6 | 1.5 to 2.5 | 0.45 to 0.55 |",
        "| a | **5** | **2** | 0.4 |",
        "| b (sealed) | 9 | 1 | **0.5** |",
        "| within the range | 1 of 2 | 1 of 2 | 1 of 2 |",
        "",
    ]


def test_groups_share_one_archive_and_the_surrogate_of_the_one_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = []

    def close(asked, out, *, archive, budget, pairs, surrogate):
        given.append((asked, out, archive, budget, pairs, surrogate))
        return SimpleNamespace(trace=SimpleNamespace(local=SimpleNamespace(surrogate=f"s{asked}")))

    monkeypatch.setattr(_groups, "close_loop", close)
    monkeypatch.setattr(_groups, "write_report", lambda closed, out, *, command, title: None)
    asked = cast(dict[str, Task], {"early": 1, "late": 2})
    found = _groups.close_groups(tmp_path, asked, budget=7, command="", title="")
    archive = tmp_path / "archive"
    assert list(found) == ["early", "late"]
    assert given == [
        (1, tmp_path / "early", archive, 7, 0, None),
        (2, tmp_path / "late", archive, 7, 0, "s1"),
    ]


def test_a_groups_verdict_says_which_models_were_not_tested() -> None:
    models = [SimpleNamespace(effects=("a", "b"), log_probability=3.14, p_after=0.5)]
    models.append(SimpleNamespace(effects=("c",), log_probability=-1.0, p_after=float("nan")))
    closed = SimpleNamespace(
        verdict=SimpleNamespace(kind="EFFECTS", named=("a", "b"), reason="so"),
        trace=SimpleNamespace(explanations=models, beyond=("beyond",)),
    )
    lines = _groups.verdict_lines("early", cast(Closed, closed))
    assert lines[:3] == ["## early", "", "EFFECTS a, b: so"]
    assert lines[6:] == ["| a + b | 3.1 | 0.5 |", "| c | -1.0 | not tested |", "", "- beyond", ""]


def test_the_budgets_of_the_measured_studies_afford_their_libraries(tmp_path: Path) -> None:
    rings = [loop_rings.task(tmp_path, group) for group in loop_rings.GROUPS]
    drums = [loop_drum.task(tmp_path, fitted) for fitted in ((15, 45), (15,), (45,))]
    budget = [study.poured(tmp_path)[0].count for study in (loop_rings, loop_drum, loop_column)]
    mounds = [loop_mounds.task(tmp_path, group) for group in loop_mounds.GROUPS]
    of_mounds = loop_mounds.poured(tmp_path)[0].count
    for tasks, pours in ((rings, budget[0]), (drums, budget[1]), (mounds, of_mounds)):
        plans = [planned(asked, pours, 0, rules=Thresholds()) for asked in tasks]
        assert all(plan.pours < pours for plan in plans)
    rounds = loop_column._ROUNDS
    plan = planned(loop_column.task(tmp_path), budget[2], 0, rounds=rounds, rules=Thresholds())
    assert plan.pours < budget[2]


def test_an_archive_takes_further_effects_and_keeps_its_pours(tmp_path: Path) -> None:
    asked = task(False, averaged=True, effects=("tilt.y", "count"))
    tilt, count = sorted(asked.library, key=lambda effect: effect.name, reverse=True)

    def archive(*library: LibraryEffect) -> Archive:
        plan = ArchivePlan(
            scene=asked.at_first(),
            prior=asked.prior,
            conditions=asked.inputs,
            library=library,
            base=4,
            each=4,
            places=asked.places,
        )
        return Archive(tmp_path / "archive", plan)

    first = archive(tilt)
    first.fill(threads=1, say=lambda _: None, progress=False)
    before = first.pours()
    both = archive(tilt, count)
    both.fill(threads=1, say=lambda _: None, progress=False)
    after = both.pours()
    # A pour for each of four strengths at each of two places.
    assert len(after.x) + after.left_out.total == len(before.x) + before.left_out.total + 8
    assert np.array_equal(after.x[: len(before.x)], before.x)
    # The first still has its own; another order has other seeds, and is refused.
    assert np.array_equal(archive(tilt).pours().x, before.x)
    with pytest.raises(TrainingDataError, match="of other effects: it has tilt.y, count; this"):
        archive(count, tilt)
