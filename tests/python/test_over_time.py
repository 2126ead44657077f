"""What happened over time: simulations that are stopped on the way, trajectories, contacts."""

import pickle
from typing import Any

import numpy as np
import pytest

import granulcal as gc

GRAVITY = 9.81
DROP = gc.Scene.drop(0.02, count=60, preset="fast")


def one_grain(height: float, **more: float | str) -> gc.Scene:
    """Returns a scene of one grain of 4 mm, its centre so high."""
    text = gc.Scene.drop(height, count=1).to_toml()
    start = text.index("[start]")
    end = text.find("\n[", start + 1)
    listed = f'[start]\nkind = "positions"\npositions = [[0.0, 0.0, {height}]]\n'
    return gc.Scene.from_toml(text[:start] + listed + text[end:]).with_(more)


def with_shape(scene: gc.Scene, shape: str) -> gc.Scene:
    return gc.Scene.from_toml(scene.to_toml().replace("[grains]", f"[grains]\nshape = {shape}"))


def test_a_grain_that_is_let_go_falls_along_a_parabola() -> None:
    pour = gc.simulate(one_grain(0.5), every=0.01)
    seen = pour.trajectory
    dt = gc.Simulation(one_grain(0.5)).substep
    falls = seen.times < 0.3
    t = seen.times[falls]
    assert len(t) == 30 and np.allclose(t, np.arange(30) * 0.01, rtol=0, atol=1e-12)
    # It rests at -dt / 2, where its velocity lives that the first substep begins with.
    fallen = 0.5 * GRAVITY * ((t + 0.5 * dt) ** 2 - (0.5 * dt) ** 2)
    assert np.abs(seen.positions[falls, 0, 2] - (0.5 - fallen)).max() < 1e-12
    assert np.abs(seen.velocities[falls, 0, 2] + GRAVITY * t).max() < 1e-11
    assert np.all(seen.positions[falls, 0, :2] == 0.0)
    # Energies [J]: what is lost of height is there as motion.
    mass = 1300.0 * np.pi / 6 * 4e-3**3
    assert seen.masses == pytest.approx([mass], rel=1e-12)
    assert seen.potential_energy[0] == pytest.approx(mass * GRAVITY * 0.5, rel=1e-12)
    total = seen.kinetic_energy + seen.potential_energy
    assert np.ptp(total[falls]) < 1e-9 * total[0]


def test_a_grain_that_rests_has_the_energy_that_is_stated_of_it() -> None:
    simulation = gc.Simulation(one_grain(0.01))
    simulation.advance(9.0)
    assert simulation.status == "at_rest" and abs(simulation.velocities[0, 2]) < 1e-9
    told = simulation.kinetic_energy / simulation.masses.sum()
    assert told == pytest.approx((GRAVITY * simulation.substep) ** 2 / 8, rel=1e-3)


def test_a_frame_is_there_at_the_start_at_every_time_and_at_the_end() -> None:
    pour = gc.simulate(DROP, seed=3, every=0.02)
    seen = pour.trajectory
    assert np.array_equal(seen.positions[0], DROP.start(3)[0])
    assert np.array_equal(seen.positions[-1], pour.positions)
    assert np.array_equal(seen.velocities[-1], pour.velocities)
    assert np.array_equal(seen.angular_velocities[-1], pour.angular_velocities)
    assert seen.times[-1] == pour.simulated_s
    # At the nearest substep, and rounding does not add up.
    ideal = 0.02 * np.arange(len(seen) - 1)
    assert np.abs(seen.times[:-1] - ideal).max() <= 0.5 / 900 + 1e-12
    count = len(seen)
    assert seen.positions.shape == seen.velocities.shape == (count, 60, 3)
    assert seen.orientations.shape == (count, 0, 4)
    assert seen.radii.shape == seen.masses.shape == (60,)
    assert seen.kinetic_energy.shape == seen.potential_energy.shape == (count,)
    assert repr(seen).startswith(f"Trajectory({count} times from 0 to ")
    for array in (seen.times, seen.positions, seen.kinetic_energy, pour.contacts.forces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_looking_changes_no_bit_and_threads_do_not_matter() -> None:
    plain = gc.simulate(DROP, seed=3)
    seen = [gc.simulate(DROP, seed=3, every=every) for every in (0.0017, 0.1, np.inf)]
    seen.append(gc.simulate(DROP, seed=3, threads=2, every=0.0017))
    assert {pour.state_hash for pour in seen} == {plain.state_hash}
    assert np.array_equal(seen[0].trajectory.positions, seen[3].trajectory.positions)
    assert len(seen[2].trajectory) == 2
    simulation = gc.Simulation(DROP, seed=3, threads=2)
    while simulation.status is None:
        simulation.advance(0.013)
        assert np.all(np.isfinite(simulation.positions))
        simulation.contacts()
    assert simulation.pour().state_hash == plain.state_hash
    assert (simulation.status, simulation.time) == (plain.status, plain.simulated_s)


def test_what_a_scene_observes_is_the_same_with_frames() -> None:
    text = DROP.to_toml() + "\n[observe]\nrate = 90.0\n[observe.front]\ntimes = [0.05, 0.1]\n"
    scene = gc.Scene.from_toml(text)
    plain, seen = gc.simulate(scene, seed=3), gc.simulate(scene, seed=3, every=0.007)
    assert np.array_equal(plain.observed().values, seen.observed().values)
    for ours, theirs in zip(plain.series("front_radius"), seen.series("front_radius"), strict=True):
        assert np.array_equal(ours, theirs)


def test_the_ground_carries_the_weight_of_a_pile_and_each_grain_is_held() -> None:
    scene = gc.Scene.drop(0.0, count=200).with_({"end.kinetic_energy": 1e-12})
    pour = gc.simulate(scene, seed=2)
    contacts = pour.contacts
    assert pour.status == "at_rest" and len(contacts) > 200
    weight = GRAVITY * pour.masses.sum()
    on_ground = contacts.at_wall("ground")
    assert contacts.forces[on_ground].sum(axis=0) == pytest.approx(
        [0.0, 0.0, weight], abs=1e-3 * weight
    )
    # Newton's third law, and every grain at rest: its contacts carry it. The solver's tolerance is
    # some hundredths of a grain's weight.
    held = np.zeros((200, 3))
    np.add.at(held, contacts.pairs[:, 0], contacts.forces)
    between = ~on_ground
    np.add.at(held, contacts.pairs[between, 1], -contacts.forces[between])
    held /= GRAVITY * pour.masses[:, None]
    assert np.abs(held - [0.0, 0.0, 1.0]).max() < 0.05
    # Geometry: points on both surfaces, unit normals from the second to the first, Coulomb's cone.
    one, other = contacts.pairs[between].T
    assert np.all(contacts.pairs[on_ground, 1] == -1) and np.all(contacts.walls[between] == -1)
    apart = pour.positions[one] - pour.positions[other]
    gap = np.linalg.norm(apart, axis=1)
    assert np.abs(apart / gap[:, None] - contacts.normals[between]).max() < 1e-3
    assert np.allclose(contacts.normals[on_ground], [0, 0, 1])
    arms = np.linalg.norm(contacts.points - pour.positions[contacts.pairs[:, 0]], axis=1)
    assert np.allclose(arms, 0.002, rtol=1e-12)
    assert np.abs(contacts.points[on_ground, 2]).max() < 0.05 * 0.002
    normal = (contacts.forces * contacts.normals).sum(axis=1)
    across = np.linalg.norm(contacts.forces - normal[:, None] * contacts.normals, axis=1)
    assert np.all(normal > 0) and np.all(across <= 0.5 * normal * (1 + 1e-9) + 1e-12)


def test_walls_are_named_and_one_that_is_not_there_is_refused() -> None:
    scene = gc.Scene.funnel(0.06, count=100).with_({"funnel.stem_radius": 0.003})
    pour = gc.simulate(scene.with_({"end.horizon": 1.0}), seed=1)
    assert pour.contacts.wall_names == ("ground", "funnel", "funnel")
    held = pour.contacts.forces[pour.contacts.at_wall("funnel")].sum(axis=0)[2]
    assert held == pytest.approx(GRAVITY * pour.masses.sum(), rel=0.05)
    with pytest.raises(KeyError, match="no wall 'walls.0'; its walls are ground, funnel"):
        pour.contacts.at_wall("walls.0")


def test_unequal_grains_have_masses_of_their_own() -> None:
    scene = DROP.with_({"effects.polydispersity.cv": 0.3})
    pour = gc.simulate(scene, seed=1, every=0.05)
    expected = 1300.0 * 4 / 3 * np.pi * pour.radii**3
    assert np.allclose(pour.masses, expected, rtol=1e-12) and np.ptp(pour.masses) > 0
    assert np.array_equal(pour.trajectory.masses, pour.masses)
    ground = pour.contacts.at_wall("ground")
    carried = pour.contacts.forces[ground].sum(axis=0)[2]
    assert carried == pytest.approx(GRAVITY * pour.masses.sum(), rel=0.02)


def test_a_fluid_bears_its_share() -> None:
    """Forces are told over a mass that the fluid adds to; in newtons it is gone again."""
    scene = one_grain(0.004).with_(
        {"effects.fluid.density": 1000.0, "effects.fluid.viscosity": 1e-3}
    )
    pour = gc.simulate(scene, seed=1)
    volume = np.pi / 6 * 4e-3**3
    assert pour.masses[0] == pytest.approx(1300.0 * volume)
    assert pour.contacts.forces[0, 2] == pytest.approx(300.0 * volume * GRAVITY, rel=2e-3)


def test_grains_that_leave_are_nan_from_then_on() -> None:
    text = gc.Scene.drop(0.1, count=30).to_toml()
    scene = gc.Scene.from_toml(text + "\n[outflow]\nbelow = 0.05\n")
    pour = gc.simulate(scene, seed=1, every=0.01)
    seen = pour.trajectory
    assert seen.positions.shape[1] == 30 and len(pour.positions) < 30
    there = np.isfinite(seen.positions[:, :, 2])
    assert there[0].all() and not there[-1].any()
    assert np.all(np.diff(there.astype(int), axis=0) <= 0)
    assert np.array_equal(np.isfinite(seen.velocities[:, :, 0]), there)
    simulation = gc.Simulation(scene, seed=1)
    simulation.advance_to(seen.times[np.argmax(there.sum(axis=1) < 30)])
    assert 0 < len(simulation.numbers) < 30
    assert np.all(np.diff(simulation.numbers) > 0)
    assert len(simulation.positions) == len(simulation.numbers) == len(simulation.masses)


def test_bodies_are_turned_over_time_and_tell_no_contacts() -> None:
    scene = with_shape(DROP, '{ kind = "box", aspect = [1.0, 1.0, 1.0] }')
    pour = gc.simulate(scene, seed=1, every=0.05)
    seen = pour.trajectory
    assert seen.orientations.shape == (len(seen), 60, 4)
    assert np.allclose(np.linalg.norm(seen.orientations, axis=2), 1.0)
    assert np.array_equal(seen.orientations[-1], pour.orientations)
    assert np.allclose(pour.masses, 1300.0 * 4e-3**3)
    for contacts in (lambda: pour.contacts, gc.Simulation(scene).contacts):
        with pytest.raises(ValueError, match="contact cannot be told of a scene with grains.shape"):
            contacts()


def test_clumps_are_told_sphere_by_sphere() -> None:
    scene = DROP.with_({"effects.clump.spheres": 3, "effects.clump.aspect": 1.5})
    pour = gc.simulate(scene, seed=1, every=0.05)
    assert pour.trajectory.positions.shape[1:] == (180, 3)
    assert pour.masses.sum() == pytest.approx(60 * 1300.0 * np.pi / 6 * 4e-3**3)
    carried = pour.contacts.forces[pour.contacts.at_wall("ground")].sum(axis=0)[2]
    assert carried == pytest.approx(GRAVITY * pour.masses.sum(), rel=0.05)


def test_a_simulation_shows_where_it_is() -> None:
    simulation = gc.Simulation(DROP, seed=3)
    assert (simulation.time, simulation.status, len(simulation.contacts())) == (0.0, None, 0)
    assert np.array_equal(simulation.numbers, np.arange(60))
    before = simulation.positions
    simulation.advance(0.05)
    assert simulation.time == pytest.approx(0.05, abs=simulation.substep)
    assert np.all(simulation.positions[:, 2] < before[:, 2]), "arrays are copies"
    time = simulation.time
    simulation.advance_to(0.01)
    simulation.advance(0.0)
    assert simulation.time == time
    cut = simulation.pour()
    assert cut.status == "horizon" and cut.simulated_s == time
    simulation.advance(np.inf)
    assert simulation.status == "at_rest" and simulation.pour().seed == 3
    assert repr(simulation).endswith("at_rest)")
    with pytest.raises(TypeError, match="a Simulation stays in its process"):
        pickle.dumps(simulation)


def test_frames_are_of_the_simulation_itself_and_go_on_from_where_it_is() -> None:
    simulation = gc.Simulation(DROP, seed=3)
    simulation.advance(0.03)
    times = [now.time for now in simulation.frames(0.02)]
    assert times[0] == pytest.approx(0.03, abs=1e-3)
    assert times[1] == pytest.approx(times[0] + 0.02, abs=1e-3)
    assert times[-1] == gc.simulate(DROP, seed=3).simulated_s


def test_what_cannot_be_is_refused_by_name() -> None:
    simulation = gc.Simulation(DROP)
    word: Any = "drop"
    for call, kind, told in (
        (lambda: simulation.advance(-1.0), ValueError, "seconds must be at least 0, got -1"),
        (lambda: simulation.advance(np.nan), ValueError, "seconds must be at least 0, got nan"),
        (lambda: simulation.advance(word), TypeError, "seconds must be a number, got 'drop'"),
        (lambda: simulation.advance(1e-4), ValueError, "at least half a substep of 0.0011"),
        (lambda: simulation.advance_to(np.nan), ValueError, "time must be a number of seconds"),
        (lambda: simulation.frames(1e-4), ValueError, "every must be at least a substep, 0.0011"),
        (lambda: gc.simulate(DROP, every=0.0), ValueError, "every must be at least a substep"),
        (lambda: gc.simulate(DROP, every=np.nan), ValueError, "every must be at least a substep"),
        (lambda: gc.simulate(DROP, every=True), TypeError, "every must be a number, got True"),
        (lambda: gc.Simulation(word), TypeError, "scene must be a Scene"),
        (lambda: gc.Simulation(DROP, seed=-1), ValueError, "seed must be at least 0"),
        (lambda: gc.Simulation(DROP, threads=0), ValueError, "threads must be at least 1"),
        (lambda: gc.simulate(DROP).trajectory, ValueError, r"simulate\(scene, every=0.02\)"),
    ):
        with pytest.raises(kind, match=told):
            call()


def test_more_frames_than_there_is_memory_for_are_refused() -> None:
    scene = gc.Scene.drop(0.1, count=2000, preset="accurate").with_({"end.horizon": 1e6})
    with pytest.raises(ValueError, match=r"needs about .* GB of memory, and .* are free"):
        gc.simulate(scene, every=1 / 6000)


def test_another_simulator_leaves_neither_frames_nor_contacts() -> None:
    engine = gc.engines.CallableEngine(lambda scene, seed: scene.start(seed), name="still")
    pour = gc.simulate(DROP, engine=engine)
    assert np.allclose(pour.masses, 1300.0 * np.pi / 6 * 4e-3**3)
    with pytest.raises(ValueError, match="another simulator leaves its grains alone"):
        _ = pour.contacts
    with pytest.raises(ValueError, match=r"every=0.1 is not for the engine 'still'"):
        gc.simulate(DROP, engine=engine, every=0.1)
