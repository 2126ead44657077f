//! Many grains: rest, energy, penetration, slope.

use granulcal::dem::{MAX_ENERGY_CREATED, Material, Preset, Simulation, SolverSettings, Status};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, block, drop_of, material, start};

/// Farthest that any grain is from where it was `[m]`.
fn farthest(simulation: &Simulation, from: &[Vector3<f64>]) -> f64 {
    simulation.positions().iter().zip(from).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

/// Deepest overlap of two grains or of a grain and the ground `[m]`.
fn deepest(positions: &[Vector3<f64>]) -> f64 {
    let mut deepest = 0.0_f64;
    for (i, a) in positions.iter().enumerate() {
        deepest = deepest.max(RADIUS - a.z);
        for b in &positions[..i] {
            deepest = deepest.max(2.0 * RADIUS - (a - b).norm());
        }
    }
    deepest
}

#[test]
fn a_pile_at_rest_does_not_creep() {
    let mut scene = drop_of(200, 0.01, material(0.6, 0.3, 0.3));
    scene.end.kinetic_energy = f64::MIN_POSITIVE;
    scene.end.horizon = 100.0;
    let mut simulation = start(&scene);
    simulation.advance(2.0);
    let rest = simulation.positions();
    assert!(deepest(&rest) < 1.01e-5);
    // Not a picometre in ten seconds; the overlap is the slop of 0.01 mm.
    simulation.advance(10.0);
    assert!(farthest(&simulation, &rest) < 1e-12);
}

#[test]
fn a_column_stands() {
    // Ten grains exactly on top of each other: weight adds up over ten contacts in a row.
    let scene = block([1, 1, 10], 2.0 * RADIUS + 1e-5, RADIUS + 1e-5, material(0.5, 0.1, 0.0));
    let mut simulation = start(&scene);
    simulation.advance(1.0);
    let rest = simulation.positions();
    assert!(deepest(&rest) < 2e-5); // twice the slop
    simulation.advance(1.0);
    // A contact whose gap is 0 to the bit may still sink into its slop of 0.01 mm, each of ten.
    assert!(farthest(&simulation, &rest) < 10.0 * 1.1e-5);
}

#[test]
fn no_material_creates_energy() {
    for sliding_friction in [0.0, 0.3, 1.0] {
        for rolling_friction in [0.0, 0.1, 1.0] {
            for restitution in [0.0, 0.5, 1.0] {
                for tangential_restitution in [0.0, 0.8] {
                    let grains = Material {
                        sliding_friction,
                        rolling_friction,
                        restitution,
                        tangential_restitution,
                        torsional_friction: 0.1,
                        ..Material::default()
                    };
                    // A margin of a radius lists every neighbour in time: the law without late contacts.
                    let settings = SolverSettings { margin: 1.0, ..Preset::Default.settings() };
                    let mut simulation = start(&drop_of(60, 0.02, grains))
                        .with_settings(settings)
                        .expect("valid settings");
                    simulation.advance(0.4);
                    let health = simulation.health();
                    assert!(health.energy_created <= MAX_ENERGY_CREATED, "{grains:?} {health:?}");
                    assert!(health.worst_penetration < 0.1, "{grains:?} {health:?}");
                    assert_eq!(health.grains_lost, 0);
                    // No impact gives energy, not even to rounding of its hundreds of turns.
                    let ratio = simulation.impact_work().largest_energy_ratio;
                    assert!((0.5..1.0 + 1e-14).contains(&ratio), "{grains:?} {ratio}");
                }
            }
        }
    }
}

#[test]
fn late_contacts_create_no_energy() {
    for preset in [Preset::Fast, Preset::Default] {
        for e in [0.5, 0.8, 0.9] {
            let mut scene = drop_of(300, 0.2, material(0.0, 0.0, e));
            scene.preset = preset;
            let mut simulation = start(&scene);
            simulation.advance(0.3);
            let created = simulation.health().energy_created;
            assert!(created <= MAX_ENERGY_CREATED, "{preset} e {e}: {created}");
        }
    }
}

#[test]
fn penetration_stays_below_each_presets_bound() {
    for preset in [Preset::Fast, Preset::Default] {
        for e in [0.0, 0.5, 0.9] {
            assert_penetration(preset, e);
        }
    }
}

#[test]
#[ignore = "about ten times the work of the default preset"]
fn penetration_stays_below_the_accurate_presets_bound() {
    for e in [0.0, 0.5, 0.9] {
        assert_penetration(Preset::Accurate, e);
    }
}

/// 300 grains from 0.2 m: 2 m/s on the ground and on those below.
fn assert_penetration(preset: Preset, e: f64) {
    let mut scene = drop_of(300, 0.2, material(0.5, 0.1, e));
    scene.preset = preset;
    let mut simulation = start(&scene);
    simulation.advance(0.5);
    let health = simulation.health();
    assert!(
        health.worst_penetration < preset.settings().max_penetration,
        "{preset} e {e}: {health:?}"
    );
}

#[test]
fn a_pile_is_higher_the_rougher_its_grains() {
    let mean_height = |friction| {
        let heights = (0..2).map(|seed| {
            let scene = drop_of(400, 0.01, material(friction, 0.3, 0.2));
            let pour = Simulation::new(&scene, seed).expect("a valid scene").run();
            let ended = matches!(pour.status, Status::AtRest | Status::OutOfView);
            assert!(ended, "{friction} {:?} {:?}", pour.status, pour.health);
            pour.positions.iter().map(|p| p.z).sum::<f64>() / 400.0
        });
        heights.sum::<f64>() / 2.0
    };
    let heights = [0.05, 0.2, 0.5, 1.0].map(mean_height);
    assert!(heights.windows(2).all(|pair| pair[1] > pair[0]), "{heights:?}");
}
