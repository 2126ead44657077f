//! A grain left to itself on level ground: rolling resistance, slip to roll, torsion.
//!
//! Some tests let a ramp or a pull set the grain in motion and begin with the motion that they find; the others
//! throw it.

use granulcal::dem::{
    GRAVITY, Ground, Material, Preset, Scene, Shape, Simulation, Start, Wall, WallMaterial,
};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, material, motion, one_grain, start};

/// A grain that slides down a frictionless ramp of slope 1/2 from 5 cm and lands without a bounce.
fn ramp(sliding_friction: f64, rolling_friction: f64) -> Scene {
    let slope: f64 = 0.5;
    let (sin, cos) = slope.atan().sin_cos();
    let drop = 0.05;
    let mut scene =
        one_grain(drop + RADIUS / cos, material(sliding_friction, rolling_friction, 0.0));
    scene.walls.push(Wall::fixed(
        Shape::Plane { point: [0.0, 0.0, drop], normal: [sin, 0.0, cos] },
        WallMaterial {
            sliding_friction: Some(0.0),
            rolling_friction: Some(0.0),
            ..WallMaterial::default()
        },
    ));
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
    let shape = Shape::Plane { point: [0.05, 0.0, 0.0], normal: [-1.0, 1.0, 0.0] };
    scene.walls.push(Wall::fixed(shape, WallMaterial::default()));
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

/// A grain on the ground that moves along x with `velocity` and turns with r omega = `spin` `[m/s]`.
fn thrown(material: Material, velocity: f64, spin: Vector3<f64>) -> Simulation {
    let mut simulation = start(&one_grain(RADIUS, material));
    let velocity = Vector3::new(velocity, 0.0, 0.0);
    simulation.set_motion(0, velocity, spin / RADIUS).expect("a valid motion");
    simulation
}

fn assert_within(got: f64, expected: f64, relative: f64) {
    assert!((got / expected - 1.0).abs() < relative, "{got}, expected {expected}");
}

#[test]
fn slip_turns_to_roll_at_two_sevenths_of_the_stopping_time() {
    // t = 2 v / (7 mu_s g), then v_end = 5/7 v for good: the bar is 0.5 % for both.
    let dt = Preset::Default.settings().dt;
    for (sliding_friction, speed) in [(0.1, 0.5), (0.2, 1.0), (0.5, 3.0)] {
        let mut simulation = thrown(material(sliding_friction, 0.0, 0.5), speed, Vector3::zeros());
        let slip = |simulation: &Simulation| {
            let grain = motion(simulation, 0);
            grain.v.x - grain.w.y
        };
        let (mut before, mut now) = (speed, slip(&simulation));
        let mut lost = 0.0;
        while now > 1e-9 {
            simulation.advance(dt);
            (before, now) = (now, slip(&simulation));
            lost = if now > 1e-9 { before - now } else { lost };
        }
        // Slip falls linearly: it ends part of the way through the last substep.
        let time = simulation.time() - dt + dt * before / lost;
        assert_within(time, 2.0 * speed / (7.0 * sliding_friction * GRAVITY), 1e-9);
        simulation.advance(1.0);
        let end = motion(&simulation, 0);
        assert_within(end.v.x, 5.0 / 7.0 * speed, 1e-9);
        assert_within(end.w.y, 5.0 / 7.0 * speed, 1e-9);
    }
}

#[test]
fn a_rolling_grain_stops_after_its_way() {
    // Rolls 7 v^2 / (10 mu_r g) in 7 v / (5 mu_r g); the bar is 0.5 %.
    let dt = Preset::Default.settings().dt;
    for rolling_friction in [0.02, 0.1, 0.3] {
        let speed = 0.5;
        let spin = Vector3::new(0.0, speed, 0.0);
        let mut simulation = thrown(material(1.0, rolling_friction, 0.5), speed, spin);
        let time = 1.4 * speed / (rolling_friction * GRAVITY);
        simulation.advance(0.5 * time);
        assert_within(motion(&simulation, 0).v.x, 0.5 * speed, 2.0 * dt / time);
        simulation.advance(0.45 * time);
        assert!(motion(&simulation, 0).v.x > 0.0);
        simulation.advance(0.06 * time + 0.1);
        let stopped = motion(&simulation, 0);
        assert!(stopped.v.norm() < 1e-9 && stopped.w.norm() < 1e-9, "{stopped:?}");
        // The last substep's velocity counts for the whole of it: half a substep of the speed at the start.
        let way = 0.7 * speed * speed / (rolling_friction * GRAVITY);
        assert!((stopped.x.x - way).abs() < 0.51 * dt * speed, "{stopped:?}, expected {way}");
        assert!((stopped.x.x / way - 1.0).abs() < 5e-3, "{stopped:?}, expected {way}");
    }
}

#[test]
fn a_top_spins_down() {
    // d(r omega)/dt = 5/2 mu_t g about the vertical, and it neither moves nor turns afterwards.
    for torsional_friction in [0.01, 0.1] {
        let spin = Vector3::new(0.0, 0.0, 0.5);
        let grains = Material { torsional_friction, ..Material::default() };
        let mut scene = one_grain(RADIUS, grains);
        // A top alone would be at rest to the end rule, which looks at centres: another grain falls meanwhile.
        scene.grains.count = 2;
        scene.start = Start::Positions { positions: vec![[0.0, 0.0, RADIUS], [1.0, 0.0, 1e3]] };
        let mut simulation = start(&scene);
        simulation.set_motion(0, Vector3::zeros(), spin / RADIUS).expect("a valid motion");
        let time = 0.5 / (2.5 * torsional_friction * GRAVITY);
        simulation.advance(0.25 * time);
        let turning = motion(&simulation, 0).w.z;
        assert_within(0.5 - turning, 2.5 * torsional_friction * GRAVITY * simulation.time(), 1e-9);
        simulation.advance(0.76 * time);
        let stopped = motion(&simulation, 0);
        assert!(stopped.w.norm() < 1e-12 && stopped.v.norm() < 1e-12, "{stopped:?}");
    }
}
