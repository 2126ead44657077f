"""Faults of series and profiles: operators with known answers; tolerances that go by a path."""

from pathlib import Path

import numpy as np
import pytest

from granulcal.errors import ObservationError, TrainingDataError
from granulcal.loop.effects.law import LAW, law_numbers
from granulcal.loop.effects.library import by_name
from granulcal.loop.effects.nuisances import declared_nuisances
from granulcal.loop.effects.series_faults import KINDS, require_series, reread
from granulcal.loop.pours.archive import Archive, ArchivePlan
from granulcal.loop.task import FIT, Condition, Task
from granulcal.pours.scene import Scene
from granulcal.prior import Parameter, Prior

NAMES = ("front_radius[0.1]", "front_radius[0.3]", "front_radius[0.2]", "front_radius[end]")
PROFILE = ("surface_z[-0.02]", "surface_z[0]", "surface_z[0.02]", "surface_slope")


def test_a_clock_that_is_off_reads_the_series_elsewhere() -> None:
    # X(t) = 1 + 2 t, columns in any order; what is read at the end is moved by no clock.
    at = np.array([0.1, 0.3, 0.2])
    rows = np.append(1 + 2 * at, 1.9)[None]
    read = reread(NAMES, rows, {"clock_offset": 0.05})[0]
    assert read == pytest.approx([*(1 + 2 * (at + 0.05)), 1.9])
    read = reread(NAMES, rows, {"clock_scale": -0.2})[0]
    assert read == pytest.approx([*(1 + 2 * 0.8 * at), 1.9])
    # Bent between samples: halfway between 0.1 and 0.2 it is their mean.
    bent = reread(NAMES, np.array([[1.0, 9.0, 4.0, 9.0]]), {"clock_offset": 0.05})[0]
    assert bent == pytest.approx([2.5, 11.5, 6.5, 9.0])
    both = reread(NAMES, np.repeat(rows, 2, axis=0), {"clock_offset": np.array([0.0, 0.1])})
    assert both[0] == pytest.approx(rows[0]) and both[1, 0] == pytest.approx(1.4)


def test_a_frame_that_is_off_moves_and_turns_the_profile() -> None:
    x = np.array([-0.02, 0.0, 0.02])
    rows = np.append(0.001 - 0.8 * x, np.degrees(np.arctan(0.8)))[None]
    read = reread(PROFILE, rows, {"frame_x": 0.005, "frame_z": 0.002})[0]
    assert read[:3] == pytest.approx(0.001 - 0.8 * (x + 0.005) + 0.002)
    assert read[3] == rows[0, 3]
    read = reread(PROFILE, rows, {"frame_turn": 0.01})[0]
    assert read[:3] == pytest.approx(0.001 - 0.81 * x)
    assert read[3] == pytest.approx(rows[0, 3] + np.degrees(0.01))
    read = reread(PROFILE, rows, {"length_scale": 0.1})[0]
    assert read[:3] == pytest.approx(1.1 * rows[0, :3]) and read[3] == rows[0, 3]


@pytest.mark.parametrize("kind", KINDS)
def test_no_fault_changes_nothing(kind: str) -> None:
    rows = np.random.default_rng(0).random((5, 8))
    assert np.allclose(reread((*NAMES, *PROFILE), rows, {kind: 0.0}), rows, rtol=0, atol=1e-15)
    assert np.abs(reread((*NAMES, *PROFILE), rows, {kind: 0.01}) - rows).max() > 1e-4


def observing(observe: str) -> Scene:
    text = Scene.drop(0.02, count=40).with_(preset="fast").to_toml()
    return Scene.from_toml(f"{text}\n[observe]\nrate = 200.0\n{observe}")


FRONT = "[observe.front]\ntimes = [0.05, 0.1, 0.15]\n"


def test_effects_of_a_series_need_one() -> None:
    require_series(observing(FRONT), [("clock.offset", "clock_offset")])
    with pytest.raises(ObservationError, match=r"frame.x acts on .* observes front_radius\[0.05\]"):
        require_series(observing(FRONT), [("frame.x", "frame_x")])
    with pytest.raises(ObservationError, match="clock.offset acts on .* observes nothing"):
        require_series(Scene.drop(0.02), [("clock.offset", "clock_offset")])


def prior() -> Prior:
    one = Parameter(path="material.restitution", distribution="uniform", low=0.2, high=0.6)
    return Prior([one])


def test_a_clock_costs_no_pour_and_a_path_is_a_tolerance(tmp_path: Path) -> None:
    scene = observing(FRONT)
    table = {"observe.front.level": 0.05, "clock.offset": {"sd": 0.01, "shared": False}}
    clock, level = declared_nuisances(table, scene)
    assert clock.nuisance_sd == pytest.approx(0.2) and not clock.is_shared
    assert level.nuisance_sd == 0.5 and level.is_shared
    assert [level.value(psi) for psi in (-1, 0, 1)] == pytest.approx([0.4, 0.5, 0.6])
    plan = ArchivePlan(
        scene=scene, prior=prior(), conditions=(), library=(clock, level), base=12, each=6, seed=3
    )
    assert plan.pours == 18 and plan.design.candidates == ()
    store = Archive(tmp_path / "archive", plan)
    store.fill(threads=1, say=lambda _: None, progress=False)
    rows = store.pours()
    off = rows.psi[:, 0] != 0
    assert off.sum() == 12 and (rows.psi[~off][12:, 1] != 0).all()
    # Copies of base pours, read at another time.
    base = {theta: x for theta, x in zip(rows.theta[:12, 0], rows.x[:12], strict=True)}
    for theta, psi, x in zip(rows.theta[off, 0], rows.psi[off, 0], rows.x[off], strict=True):
        expected = reread(rows.names, base[theta][None], {"clock_offset": 0.05 * psi})[0]
        assert x == pytest.approx(expected)


def test_tolerances_that_cannot_be_are_named() -> None:
    scene = observing(FRONT)
    with pytest.raises(TrainingDataError, match="no effect observe.frnt.level"):
        declared_nuisances({"observe.frnt.level": 0.1}, scene)
    with pytest.raises(TrainingDataError, match=r"observe.front.level must be positive, got -0.1"):
        declared_nuisances({"observe.front.level": -0.1}, scene)
    with pytest.raises(ObservationError, match="must be a number or { sd"):
        declared_nuisances({"clock.offset": {"size": 0.1}}, scene)


def test_numbers_of_the_law_are_free_where_the_scene_has_them() -> None:
    scene = Scene.funnel(height=0.1)
    (torsion,) = law_numbers(["torsional_friction"], scene)
    assert torsion.path == "material.torsional_friction" and torsion.bounds == (0.01, 0.4)
    every = law_numbers(True, scene)
    assert torsion in every and set(every) <= set(LAW) and law_numbers(False, scene) == ()
    for one in every:
        low, high = one.bounds
        assert scene.with_({one.path: low}).get(one.path) == low
        assert scene.with_({one.path: high}).get(one.path) == high
    with pytest.raises(ObservationError, match="law has no magnetism; there are touching_exponent"):
        law_numbers(["magnetism"], scene)


def test_numbers_of_the_law_that_clumps_do_not_read_are_not_free_with_them() -> None:
    clumps = Scene.funnel(height=0.1).with_({"effects.clump.aspect": 1.5})
    (torsion,) = law_numbers(True, clumps)
    assert torsion.path == "material.torsional_friction"
    with pytest.raises(ObservationError, match=r"leave softness out of law: .*effects.clump"):
        law_numbers(["softness"], clumps)
    conditions = (Condition("all", {}, FIT, (Path("a"), Path("b"), Path("c"))),)
    round_grains, clump = Scene.funnel(height=0.1), by_name(["clump", "drag"])
    free = Prior([*prior().parameters, *law_numbers(["impact_friction"], round_grains)])
    with pytest.raises(ObservationError, match=r"clump can be no candidate .*impact_friction"):
        Task(round_grains, free, conditions, clump)
    free = Prior([*prior().parameters, torsion])
    assert Task(round_grains, free, conditions, clump).library == clump


def test_a_number_that_every_fit_has_is_no_candidate() -> None:
    law = Parameter(
        path="effects.restitution_speed.exponent", distribution="uniform", low=0.0, high=0.3
    )
    conditions = (Condition("all", {}, FIT, (Path("a"), Path("b"), Path("c"))),)
    free = Prior([*prior().parameters, law])
    with pytest.raises(ObservationError, match="restitution.speed is the number effects.rest"):
        Task(Scene.funnel(height=0.1), free, conditions, by_name(["restitution.speed", "drag"]))
    task = Task(Scene.funnel(height=0.1), free, conditions, by_name(["drag"]))
    assert task.prior.names == ["material.restitution", "effects.restitution_speed.exponent"]
