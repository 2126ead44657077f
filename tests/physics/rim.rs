//! A grain that slides down a cone and past the rim of its stem.

use granulcal::dem::{Funnel, Preset, Scene, Simulation, Start};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, material};

/// A funnel whose cone ends in a stem as wide as its narrow end.
fn scene(preset: Preset) -> Scene {
    let mut scene = Scene::funnel(0.08);
    scene.preset = preset;
    scene.grains.count = 1;
    scene.material = material(0.0, 0.0, 0.0);
    scene.funnel = Some(Funnel {
        height: 0.08,
        rim_radius: 0.05,
        stem_radius: 0.018,
        cone_length: 0.05,
        stem_length: 0.01,
        ..Funnel::default()
    });
    scene
}

/// Without friction a grain slides off the end of the cone and flies on: energy and direction are those of the slope.
#[test]
fn a_grain_flies_off_the_end_of_a_cone() {
    // The slope in the half plane through the axis: down and inwards.
    let slope = Vector3::new(-0.032, 0.0, -0.05).normalize();
    let normal = Vector3::new(-0.05, 0.0, 0.032).normalize();
    for preset in [Preset::Fast, Preset::Default, Preset::Accurate] {
        for share in [0.3_f64, 0.6, 0.9] {
            let mut scene = scene(preset);
            let end = Vector3::new(0.018, 0.0, 0.09);
            let from: Vector3<f64> = end - share * 0.059 * slope + (RADIUS + 1e-6) * normal;
            scene.start = Start::Positions { positions: vec![from.into()] };
            let mut simulation = Simulation::new(&scene, 1).expect("a valid scene");
            let dt = simulation.settings().dt;
            while simulation.positions()[0].z > 0.08 {
                simulation.advance(dt);
            }
            let (at, v) = (simulation.positions()[0], simulation.velocities()[0]);
            // Velocities are those of the middle of the substep; gravity's last half is not in them.
            let fallen: f64 = from.z - at.z - 0.5 * dt * v.z.abs();
            let speed = (2.0 * 9.81 * fallen).sqrt();
            assert!((v.norm() / speed - 1.0).abs() < 0.01, "{preset} {share}: {v:?}, {speed}");
            // Inwards it keeps what it had at the end of the cone, where its contact point left.
            let at_end: f64 = 2.0 * 9.81 * share * 0.059 * -slope.z;
            let inwards = at_end.sqrt() * slope.x;
            assert!((v.x / inwards - 1.0).abs() < 0.03, "{preset} {share}: {v:?}, {inwards}");
        }
    }
}
