//! A soft layer on the ground, against springs and dampers.

use granulcal::dem::{Layer, Preset, SceneError, Simulation, Status};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, bits, drop_of, material, one_grain, start};

/// Radii by which a grain of its own weight sinks into the layers here: one over their stiffness.
const SINK: f64 = 0.05;

fn layer(thickness: f64, damping: f64) -> Layer {
    Layer { thickness, stiffness: 1.0 / SINK, damping }
}

#[test]
fn a_grain_sinks_until_the_springs_carry_it() {
    let mut scene = one_grain(RADIUS, material(0.5, 0.1, 0.5));
    scene.effects.layer = layer(1e-3, 1.0);
    let mut simulation = start(&scene);
    simulation.advance(0.5);
    let sunk = RADIUS - simulation.positions()[0].z;
    assert!((sunk / (SINK * RADIUS) - 1.0).abs() < 1e-6, "{sunk}");
    let load = simulation.wall_loads().unwrap()[0];
    assert!((load.normal_force - 9.81).abs() < 1e-6, "{load:?}");
}

/// Speed after over speed before a fall on the ground at `speed` `[m/s]`.
fn rebound(layer: Layer, speed: f64, dt: f64) -> f64 {
    let mut scene = one_grain(RADIUS + 1e-4, material(0.0, 0.0, 0.6));
    scene.effects.layer = layer;
    let simulation = start(&scene);
    let settings = granulcal::dem::SolverSettings { dt, ..*simulation.settings() };
    let mut simulation = simulation.with_settings(settings).unwrap();
    simulation.set_motion(0, Vector3::new(0.0, 0.0, -speed), Vector3::zeros()).unwrap();
    for _ in 0..1_000_000 {
        simulation.advance(dt);
        if simulation.positions()[0].z > RADIUS && simulation.velocities()[0].z > 0.0 {
            return simulation.velocities()[0].z / speed;
        }
    }
    panic!("it never comes back");
}

#[test]
fn a_grain_leaves_a_thick_layer_as_a_damped_spring_throws_it() {
    // Source: Schwager and Poeschel, Granular Matter 9 (2007) 465, for a force that never pulls; without gravity, which
    // is small beside the springs at this speed.
    for damping in [0.05_f64, 0.2, 0.5] {
        let root = (1.0 - damping * damping).sqrt();
        let turn =
            std::f64::consts::PI - (2.0 * damping * root).atan2(1.0 - 2.0 * damping * damping);
        let expected = (-damping / root * turn).exp();
        let got = rebound(layer(0.1, damping), 10.0, 2e-5);
        assert!((got - expected).abs() < 0.02, "{damping}: {got}, expected {expected}");
    }
}

#[test]
fn a_layer_of_no_thickness_is_the_hard_ground() {
    let (hard, thin) = (rebound(Layer::default(), 1.0, 5e-4), rebound(layer(1e-7, 1.0), 1.0, 5e-4));
    assert!((hard - thin).abs() < 0.01, "{hard} {thin}");
}

#[test]
fn a_heap_on_a_layer_rests_deeper_and_goes_on_from_a_checkpoint() {
    let hard = drop_of(150, 0.05, material(0.5, 0.1, 0.5));
    let mut soft = hard.clone();
    soft.effects.layer = layer(1.5e-3, 1.0);
    let whole = start(&soft).run();
    assert_eq!(whole.status, Status::AtRest);
    // Of the lower half, which lies on the ground.
    let mean = |pour: &granulcal::dem::Pour| {
        let mut heights: Vec<f64> = pour.positions.iter().map(|p| p.z).collect();
        heights.sort_by(f64::total_cmp);
        heights[..75].iter().sum::<f64>() / 75.0
    };
    let (deep, plain) = (mean(&whole), mean(&start(&hard).run()));
    assert!(deep < plain - 0.5 * SINK * RADIUS, "{deep} {plain}");

    let mut first = start(&soft);
    first.advance(0.2);
    let second = start(&soft).resume(&first.checkpoint()).unwrap();
    assert_eq!(second.run().state_hash, whole.state_hash);
    let mut threads = Simulation::new(&soft, 1).unwrap().with_threads(2).unwrap();
    threads.advance(0.2);
    assert_eq!(bits(&threads), bits(&first));
}

#[test]
fn a_method_that_does_not_know_a_layer_is_refused() {
    let mut scene = drop_of(10, 0.05, material(0.5, 0.1, 0.5));
    scene.effects.layer = layer(1e-3, 1.0);
    scene.preset = Preset::Paper;
    let error = scene.check().unwrap_err();
    assert!(matches!(error, SceneError::EffectNeedsMethod { effect: "effects.layer", .. }));
    let text = error.to_string();
    assert!(text.contains("nsgs") && text.contains("newton_pcr"), "{text}");
}
