//! Whole pours on threads and registers of every number, and states that nobody has written.

use std::sync::atomic::Ordering;

use granulcal_scene::{Ends, Funnel, GrainShape, Shape, Start, Wall};

use super::*;
use crate::contact_set::ContactSet;
use crate::energy::{Energy, Heights};
use crate::lanes::WIDEST;
use crate::{Preset, WallMaterial};

/// Some hundred grains through a funnel. In tests blocks and shares of loops are so small that threads share them.
fn scene() -> Scene {
    let mut scene = Scene::funnel(0.015);
    scene.grains.count = 500;
    scene.start = Start::Grid { counts: [8, 8, 8], spacing: 4.4e-3, jitter: 1e-4, base: 2e-3 };
    scene.funnel = Some(Funnel {
        height: 0.015,
        stem_radius: 0.014,
        rim_radius: 0.025,
        cone_length: 0.02,
        ..Funnel::default()
    });
    scene
}

fn start(scene: &Scene) -> Simulation {
    Simulation::new(scene, 2).expect("a valid scene")
}

#[test]
fn a_whole_pour_has_the_same_bits_on_any_number_of_threads() {
    let alone = start(&scene()).run();
    assert_eq!(alone.status, Status::AtRest, "{:?}", alone.health);
    for threads in [2, 4, 8] {
        let pour = start(&scene()).with_threads(threads).expect("threads").run();
        assert_eq!(pour.state_hash, alone.state_hash, "{threads} threads");
    }
    assert_eq!(start(&scene()).run(), alone);
}

#[test]
fn a_ball_among_the_grains_has_the_same_bits_on_any_number_of_threads_and_from_a_checkpoint() {
    let mut scene = scene();
    scene.intruder = Some(granulcal_scene::Intruder {
        diameter: 0.02,
        density: 2500.0,
        position: [0.004, 0.0, 0.06],
        velocity: [0.0, 0.0, -2.0],
        enters: 0.11,
    });
    let mut alone = start(&scene);
    let mut states = Vec::new();
    // Before it enters, while it falls and as it ploughs through the grains.
    for seconds in [0.1, 0.02, 0.04] {
        alone.advance(seconds);
        states.push(alone.checkpoint());
    }
    let listed = alone.contacts.pairs.lanes().filter(|&(number, lane)| {
        alone.contacts.pairs.batches[number].j[lane] as usize == scene.grains.count
    });
    assert!(listed.count() > 5, "it touches nothing");
    alone.advance(0.1);
    assert_ne!(alone.ended(), Some(Status::Unhealthy), "{:?}", alone.health());
    for threads in [2, 4] {
        let mut shared = start(&scene).with_threads(threads).expect("threads");
        shared.advance(0.26);
        assert_eq!(shared.state_hash(), alone.state_hash(), "{threads} threads");
    }
    for (state, rest) in states.iter().zip([0.16, 0.14, 0.1]) {
        let mut resumed = start(&scene).resume(state).expect("a checkpoint of it");
        resumed.advance(rest);
        assert_eq!(resumed.state_hash(), alone.state_hash());
    }
}

#[test]
fn a_whole_pour_has_the_same_bits_on_any_registers() {
    let mut scene = scene();
    scene.grains.count = 200;
    let preset = |preset| Scene { preset, ..scene.clone() };
    let shaped = |shape| {
        let mut scene = scene.clone();
        (scene.grains.shape, scene.end.horizon) = (Some(shape), 0.3);
        scene.start = Start::Grid { counts: [5, 5, 8], spacing: 8e-3, jitter: 1e-4, base: 5e-3 };
        scene
    };
    let scenes = [
        preset(Preset::Default),
        preset(Preset::Paper),
        shaped(GrainShape::Box { aspect: [1.0; 3] }),
        shaped(GrainShape::Box { aspect: [0.8, 1.0, 1.4] }),
        shaped(GrainShape::Cylinder { aspect: 1.2 }),
    ];
    for scene in scenes {
        let mut hashes = Vec::new();
        for bits in [128, 256, 512] {
            WIDEST.store(bits, Ordering::Relaxed);
            hashes.push(start(&scene).run().state_hash);
        }
        assert!(hashes.iter().all(|hash| *hash == hashes[0]), "{hashes:x?}");
    }
}

#[test]
fn what_has_rolled_away_leaves_and_what_turns_back_stays() {
    // Three grains out of view on the ground: one rolls outward, one slides outward with so much backspin that it will
    // come back, one rolls inward.
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 3;
    let at = |x: f64| [x, 0.0, scene.grains.radius()];
    scene.start = Start::Positions { positions: vec![at(0.4), at(0.45), at(0.5)] };
    scene.end.rolled_away = crate::RolledAway::Leave;
    let mut simulation = start(&scene);
    let (x, y) = (Vector3::x(), Vector3::y() / scene.grains.radius());
    for (grain, velocity, rolling) in [(0, 0.3, 0.3), (1, 0.1, -0.5), (2, -0.3, -0.3)] {
        simulation.set_motion(grain, velocity * x, rolling * y).expect("a grain");
    }
    simulation.advance(0.01);
    let left: Vec<f64> = simulation.positions().iter().map(|p| p.x).collect();
    assert_eq!(left.len(), 2, "{left:?}");
    assert!((left[0] - 0.45).abs() < 2e-3 && (left[1] - 0.497).abs() < 2e-3, "{left:?}");
    let pour = simulation.run();
    assert_eq!(pour.status, Status::OutOfView, "{:?}", pour.health);
    assert!(pour.radii_out.is_empty() && pour.positions.len() == 2);
    assert_eq!(pour.health.energy_created, 0.0);
}

#[test]
fn an_impact_that_does_not_happen_moves_no_grain() {
    // Past the flank of a cylinder: seen from the substep's begin its plane is in the way, from there it is not. The
    // contact solve has its say, but the grain moves on by one substep and not by another part of it.
    let mut scene = Scene::drop(0.1);
    scene.gravity = [0.0; 3];
    scene.grains.count = 1;
    let from = [-5e-4, 0.0, 7.02e-3 + 0.05];
    scene.start = Start::Positions { positions: vec![from] };
    let (from, to) = ([0.0, -0.1, 0.05], [0.0, 0.1, 0.05]);
    let shape = Shape::Cylinder { from, to, radius: 5e-3, closed: Ends::None };
    scene.walls.push(Wall::fixed(shape, WallMaterial::default()));
    let mut simulation = start(&scene);
    let velocity = Vector3::new(5.0, 0.0, 0.2);
    simulation.set_motion(0, velocity, Vector3::zeros()).expect("a grain");
    let (place, dt) = (simulation.positions()[0], simulation.settings().dt);
    simulation.step();
    let moved = simulation.positions()[0] - place;
    assert!((moved - dt * simulation.velocities()[0]).norm() < 1e-15, "{moved:?}");
    assert_eq!(simulation.particles.clocks, [0.0]);
}

#[test]
fn a_scene_has_its_own_substep() {
    let finer = scene().with("substep", 2e-4).expect("finer than that of `default`");
    let (mut stated, settings) = (start(&finer), *start(&finer).settings());
    assert_eq!(settings, SolverSettings { dt: 2e-4, ..Preset::Default.settings() });
    let mut set = start(&scene()).with_settings(settings).expect("valid settings");
    stated.advance(0.1);
    set.advance(0.1);
    assert_eq!(stated.positions(), set.positions());
    let mut coarser = start(&scene());
    coarser.advance(0.1);
    assert_ne!(stated.positions(), coarser.positions());
}

/// A simulation with pairs and walls in its lists.
fn flowing() -> Simulation {
    let mut simulation = start(&scene());
    simulation.advance(0.2);
    assert!(simulation.contacts.pairs.batches.len() > 8);
    assert!(!simulation.contacts.at_walls.batches.is_empty());
    simulation
}

#[test]
fn a_state_that_nobody_has_written_is_refused() {
    type Change = fn(&mut Simulation);
    let good = flowing();
    assert!(start(&scene()).resume(&good.checkpoint()).is_ok());
    let changes: [(&str, Change); 22] = [
        ("grains that are not", |s| s.particles.clocks[0] = 1e-4),
        ("grains that are not", |s| s.particles.spheres.truncate(9)),
        ("grains that are not", |s| s.particles.spheres[3].0[3] = 0.1),
        ("grains that are not", |s| s.particles.bodies[500].velocity.0[0] = 0.1),
        ("grains that are not", |s| s.particles.inverse_mass[0] = 2.0),
        ("another number of grains", |s| {
            s.watch = HealthWatch::new(3, &Energy::default(), &Heights::default(), 0.0);
        }),
        ("substeps", |s| s.seemed_ended = Some((Status::AtRest, usize::MAX))),
        ("grains that the scene has not", |s| s.contacts.pairs.batches[0].i[0] = 500),
        ("grains that the scene has not", |s| s.contacts.pairs.batches[0].j[0] = 500),
        ("grains that the scene has not", |s| s.contacts.pairs.batches[0].used = 9),
        ("grains that the scene has not", |s| s.contacts.at_walls.batches[0].j[0] = 1),
        ("grains that the scene has not", |s| s.contacts.at_walls.batches[0].i[0] = u32::MAX),
        ("without a law", |s| s.contacts.pairs.batches[0].law = 77),
        ("wall that the scene has not", |s| s.contacts.at_walls.at_walls[0].wall[0] = 3),
        ("walls that do not fit", |s| s.contacts.at_walls.at_walls.truncate(1)),
        ("walls that do not fit", |s| {
            s.contacts.pairs.at_walls = s.contacts.at_walls.at_walls.clone();
        }),
        ("laws that do not fit", |s| s.contacts.pairs.laws.clear()),
        ("all parts in turn", |s| s.contacts.pairs.parts.clear()),
        ("all contacts in turn", |s| s.contacts.pairs.parts[0].end += 1),
        ("without a part", |s| s.contacts.pairs.phases.clear()),
        ("two contacts at once", |s| {
            let batch = &mut s.contacts.pairs.batches[0];
            batch.i[1] = batch.i[0];
        }),
        ("contacts of another number", |s| {
            s.contacts.pairs = ContactSet::default();
            let mut fewer = Scene::drop(0.01);
            fewer.grains.count = 2;
            let mut simulation = start(&fewer);
            simulation.advance(0.01);
            s.contacts.pairs = simulation.contacts.pairs;
        }),
    ];
    for (number, (what, change)) in changes.into_iter().enumerate() {
        let mut bad = good.clone();
        change(&mut bad);
        let error = start(&scene()).resume(&bad.checkpoint()).expect_err(what);
        assert!(matches!(error, DemError::CheckpointState { .. }), "{number}: {error}");
        assert!(error.to_string().contains(what), "{number}: {error}");
    }
}

/// Pressed into each other they would fly apart: of a ball of these .5 radii and 8 % of energy.
#[test]
fn unequal_grains_start_apart_and_gain_nothing() {
    let mut scene = Scene::drop(0.02);
    scene.grains.count = 200;
    scene.effects.polydispersity.cv = 0.2;
    let pour = Simulation::new(&scene, 1).unwrap().run();
    let health = pour.health;
    assert!(health.worst_penetration < 0.1, "{health:?}");
    assert!(health.energy_created < 1e-6, "{health:?}");
}

/// The deepest overlap of a ball of grains that has fallen fast, with the effects that `change` puts in `[radii]`.
fn deepest_of_fallen(count: usize, seed: u64, seconds: f64, change: fn(&mut Scene)) -> f64 {
    let mut scene = Scene::drop(0.1);
    scene.grains.count = count;
    change(&mut scene);
    let mut pour = Simulation::new(&scene, seed).expect("a valid scene");
    pour.advance(seconds);
    pour.health().worst_penetration
}

#[test]
fn the_small_among_unequal_grains_are_solved_as_well() {
    // 0.13 radii of the smaller grain when contacts were solved to a typical one.
    let deepest = deepest_of_fallen(1000, 1, 0.3, |scene| scene.effects.polydispersity.cv = 0.35);
    assert!(deepest < 0.05, "{deepest}");
}

#[test]
fn clumps_that_fall_fast_enter_nothing() {
    // Struck in the contact solve they leave their ways in the same substep: 0.14 radii when nothing looked where to.
    let deepest = deepest_of_fallen(400, 0, 0.16, |scene| scene.effects.clump.aspect = 1.5);
    assert!(deepest < 0.04, "{deepest}");
}

#[test]
fn to_advance_by_infinity_is_to_the_end_and_by_less_than_half_a_substep_nothing() {
    let mut scene = scene();
    scene.grains.count = 3;
    let whole = start(&scene).run();
    let mut pour = start(&scene);
    for seconds in [0.01, f64::NAN, -1.0, 0.49 * scene.settings().dt] {
        pour.advance(seconds);
        assert!((pour.time() - 0.01).abs() < 1e-9, "{seconds}");
    }
    pour.advance(f64::INFINITY);
    assert_eq!(pour.into_pour().state_hash, whole.state_hash);
}

#[test]
fn the_substep_stays_once_one_has_been_taken() {
    let mut pour = start(&scene());
    assert_eq!((pour.scene(), pour.seed()), (&scene(), 2));
    let finer = SolverSettings { dt: 1e-4, ..*pour.settings() };
    pour = pour.with_settings(finer).unwrap();
    pour.advance(1e-3);
    pour = pour.with_settings(SolverSettings { sweeps: 7, ..finer }).unwrap();
    let error = pour.with_settings(SolverSettings { dt: 2e-4, ..finer }).unwrap_err();
    assert!(error.to_string().starts_with("settings.dt must be as before"), "{error}");
}

#[test]
fn grains_keep_their_numbers_when_others_leave() {
    let mut scene = Scene::drop(0.1);
    scene.grains.count = 3;
    let positions = vec![[0.0, 0.0, 0.3], [0.02, 0.0, 0.25], [0.04, 0.0, 0.35]];
    scene.start = Start::Positions { positions };
    scene.outflow = Some(granulcal_scene::Outflow { below: 0.2, until: None });
    let mut pour = start(&scene);
    assert_eq!(pour.numbers(), [0, 1, 2]);
    while pour.numbers().len() == 3 {
        pour.advance(1e-3);
    }
    assert_eq!(pour.numbers(), [0, 2]);
    assert!((pour.positions()[1].x - 0.04).abs() < 1e-9);
}

#[test]
fn what_a_frozen_substep_does_not_know_is_refused() {
    let mut scene = scene();
    scene.grains.count = 3;
    scene.start = Start::Grid { counts: [8, 8, 8], spacing: 8e-3, jitter: 1e-4, base: 2e-3 };
    scene.effects.clump.aspect = 1.5;
    let error = start(&scene).frozen_solve().unwrap_err().to_string();
    assert_eq!(error, "a frozen solve cannot be told of a scene with effects.clump");
    scene.effects.clump.aspect = 1.0;
    scene.grains.shape = Some(GrainShape::Box { aspect: [1.0; 3] });
    assert!(start(&scene).frozen_solve().is_err());
    assert!(start(&scene).frozen_search().is_err());
}

/// One ball that falls 48 mm, `change` made to its scene.
fn falls(change: impl Fn(&mut Scene)) -> Pour {
    let mut scene = Scene::drop(0.05);
    scene.grains.count = 1;
    scene.start = Start::Positions { positions: vec![[0.0, 0.0, 0.05]] };
    scene.end.horizon = 60.0;
    change(&mut scene);
    start(&scene).run()
}

#[test]
fn a_grain_that_falls_slowly_is_not_at_rest() {
    for gravity in [9.81, 0.28, 0.02, 1e-4] {
        let pour = falls(|scene| scene.gravity = [0.0, 0.0, -gravity]);
        let radius = 0.5 * pour.radii[0];
        assert!(pour.positions[0].z < 2.2 * radius, "g = {gravity}: {:?}", pour.positions);
    }
    // The user's own threshold is crossed in mid-air.
    let pour = falls(|scene| scene.end.kinetic_energy = 0.1);
    assert!(pour.positions[0].z < 0.02, "{:?}", pour.positions);
}

#[test]
fn a_grain_that_sinks_slower_than_the_threshold_ends_at_the_horizon() {
    let honey = |density, viscosity| {
        falls(|scene| {
            scene.effects.fluid.density = density;
            scene.effects.fluid.viscosity = viscosity;
            scene.grains.density = 2650.0;
            scene.end.horizon = 1.0;
        })
    };
    assert_eq!(honey(1260.0, 3000.0).status, Status::Horizon);
    // As dense as the grain: it stays where it is.
    assert_eq!(honey(2650.0, 3000.0).status, Status::AtRest);
}

#[test]
fn grains_of_several_spheres_in_a_funnel_are_counted_once() {
    let mut scene = Scene::funnel(0.12);
    scene.grains.count = 20;
    scene.effects.clump.aspect = 1.5;
    let pour = Simulation::new(&scene, 1).unwrap().to_pour();
    assert_eq!((pour.positions.len(), pour.grains_in_funnel), (40, 20));
}
