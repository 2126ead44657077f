//! A grain left to itself on level ground: rolling resistance, slip to roll, torsion.
//!
//! Scenes start at rest, so a ramp or a pull sets the grain in motion; each test begins with the motion
//! that it finds.

use granulcal::dem::{GRAVITY, Ground, Scene, Shape, Simulation, Wall, WallMaterial};

use crate::scenes::{RADIUS, material, motion, one_grain, start};

/// A grain that slides down a frictionless ramp of slope 1/2 from 5 cm and lands without a bounce.
fn ramp(sliding_friction: f64, rolling_friction: f64) -> Scene {
    let slope: f64 = 0.5;
    let (sin, cos) = slope.atan().sin_cos();
    let drop = 0.05;
    let mut scene =
        one_grain(drop + RADIUS / cos, material(sliding_friction, rolling_friction, 0.0));
    scene.walls.push(Wall {
        shape: Shape::Plane { point: [0.0, 0.0, drop], normal: [sin, 0.0, cos] },
        material: WallMaterial {
            sliding_friction: Some(0.0),
            rolling_friction: Some(0.0),
            ..WallMaterial::default()
        },
    });
    scene
}

/// Advances until the grain has left the ramp and lies on the ground.
fn land(scene: &Scene) -> Simulation {
    let mut simulation = start(scene);
    while simulation.positions()[0].x < 0.1 + 2.0 * RADIUS {
        simulation.advance(1e-3);
    }
    assert!((simulation.positions()[0].z - RADIUS).abs() < 2e-5);
    simulation
}

#[test]
fn rolling_friction_slows_a_rolling_grain() {
    let mut simulation = land(&ramp(1.0, 0.08));
    simulation.advance(0.05);
    let begin = motion(&simulation, 0);
    assert!((begin.v.x - begin.w.y).abs() < 1e-6 * begin.v.x, "{begin:?}");
    let time = 0.2;
    simulation.advance(time);
    let end = motion(&simulation, 0);
    let expected = 5.0 / 7.0 * 0.08 * GRAVITY;
    let slowed = (begin.v.x - end.v.x) / time;
    assert!((slowed / expected - 1.0).abs() < 1e-9, "{slowed}, expected {expected}");
    // And stops dead.
    simulation.advance(2.0);
    assert!(motion(&simulation, 0).v.norm() < 1e-12);
}

#[test]
fn a_slipping_grain_ends_up_rolling() {
    let mut simulation = land(&ramp(0.1, 0.0));
    simulation.advance(0.02); // an impact ends a substep's way above the ground: let it settle
    let begin = motion(&simulation, 0);
    let slip = begin.v.x - begin.w.y;
    assert!(slip > 0.3 * begin.v.x, "{begin:?}");
    // While it slips it loses mu_s g.
    let time = 0.05;
    simulation.advance(time);
    let slipping = motion(&simulation, 0);
    let slowed = (begin.v.x - slipping.v.x) / (0.1 * GRAVITY * time);
    assert!((slowed - 1.0).abs() < 1e-5, "{slowed}");
    // Angular momentum about the contact point stays: v_end = (5 v + 2 w) / 7.
    simulation.advance(1.0);
    let end = motion(&simulation, 0);
    let expected = (5.0 * begin.v.x + 2.0 * begin.w.y) / 7.0;
    assert!((end.v.x / expected - 1.0).abs() < 1e-9, "{end:?}, expected {expected}");
    assert!((end.w.y / expected - 1.0).abs() < 1e-9, "{end:?}, expected {expected}");
}

#[test]
fn torsion_stops_a_spinning_grain() {
    // Pulled over frictionless ground into a rough wall at 45 degrees, the grain leaves with a spin
    // about the vertical that only torsion can stop.
    // It starts as deep as resting contacts are, the solver's slop.
    let mut scene = one_grain(RADIUS - 1e-5, material(0.5, 0.0, 0.5));
    scene.gravity = [3.0, 0.0, -GRAVITY];
    scene.ground = Ground {
        material: WallMaterial {
            sliding_friction: Some(0.0),
            torsional_friction: Some(0.04),
            ..WallMaterial::default()
        },
    };
    scene.walls.push(Wall {
        shape: Shape::Plane { point: [0.05, 0.0, 0.0], normal: [-1.0, 1.0, 0.0] },
        material: WallMaterial::default(),
    });
    let mut simulation = start(&scene);
    while motion(&simulation, 0).w.norm() == 0.0 {
        simulation.advance(1.0 / 1500.0);
    }
    simulation.advance(0.02); // the impact has moved it within the slop: let it settle
    let begin = motion(&simulation, 0);
    assert!(begin.w.z.abs() > 0.1 && begin.w.z.abs() > 0.999 * begin.w.norm(), "{begin:?}");
    let time = 0.01;
    simulation.advance(time);
    let end = motion(&simulation, 0);
    // I domega/dt = mu_t r N: d(r omega)/dt = 5/2 mu_t g.
    let slowed = (begin.w.z.abs() - end.w.z.abs()) / time;
    assert!((slowed / (2.5 * 0.04 * GRAVITY) - 1.0).abs() < 1e-5, "{slowed}");
}
