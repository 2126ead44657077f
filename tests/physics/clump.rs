//! Grains of several spheres, as rigid bodies.

use granulcal::dem::{Clump, Polydispersity, Scene, SceneError, Simulation, Status};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, bits, drop_of, material, one_grain, start};

/// Two touching spheres with the volume of a ball: radius of each `[m]`.
fn rho() -> f64 {
    RADIUS / 2f64.cbrt()
}

/// Inertia across the axis over the mass, of two touching spheres `[m^2]`.
fn across() -> f64 {
    1.4 * rho() * rho()
}

fn pair(height: f64, restitution: f64) -> Scene {
    let mut scene = one_grain(height, material(0.0, 0.0, restitution));
    scene.effects.clump = Clump { spheres: 2, aspect: 2.0 };
    scene
}

/// From the first sphere to the second, unit.
fn axis(simulation: &Simulation) -> Vector3<f64> {
    let at = simulation.positions();
    (at[1] - at[0]).normalize()
}

#[test]
fn a_free_clump_is_a_symmetric_top() {
    // Without torque the axis turns about the angular momentum at |L| / I_across.
    let mut scene = pair(1.0, 0.5);
    scene.gravity = [0.0, 0.0, 0.0];
    scene.end.kinetic_energy = f64::MIN_POSITIVE;
    let mut simulation = start(&scene);
    let begin = axis(&simulation);
    let side = begin.cross(&Vector3::new(0.3, -0.5, 0.8)).normalize();
    let omega = 12.0 * side + 20.0 * begin;
    simulation.set_motion(0, Vector3::zeros(), omega).unwrap();
    let momentum = across() * 12.0 * side + 0.4 * rho() * rho() * 20.0 * begin;
    simulation.advance(0.5);
    let turn = nalgebra::Rotation3::new(0.5 * momentum / across());
    let expected = turn * begin;
    assert!((axis(&simulation) - expected).norm() < 0.02, "{} {expected}", axis(&simulation));
    assert!((simulation.positions()[1] - simulation.positions()[0]).norm() - 2.0 * rho() < 1e-12);
}

#[test]
fn a_clump_that_lands_on_one_end_turns_as_its_inertia_says() {
    let (height, speed) = (0.05, 1.0);
    let scene = pair(height, 0.6);
    let mut simulation = start(&scene);
    simulation.set_motion(0, Vector3::new(0.0, 0.0, -speed), Vector3::zeros()).unwrap();
    let axis = axis(&simulation);
    while simulation.angular_velocities()[0].norm() < 1e-6 {
        assert!(simulation.time() < 0.2, "it never lands");
        simulation.advance(1.0 / 2000.0);
    }
    // The lower sphere's centre from the middle, and the impulse of Newton's law along the vertical.
    let arm = if axis.z < 0.0 { rho() * axis } else { -rho() * axis };
    let twist = arm.cross(&Vector3::z());
    let compliance = 1.0 + twist.norm_squared() / across();
    let fallen = height - rho() * axis.z.abs() - rho();
    let speed = (speed * speed + 2.0 * 9.81 * fallen).sqrt();
    let impulse = 1.6 * speed / compliance;
    let rise = simulation.velocities().iter().map(|v| v.z).sum::<f64>() / 2.0;
    assert!((rise - (impulse - speed)).abs() < 0.02 * impulse, "{rise} {}", impulse - speed);
    let omega = simulation.angular_velocities()[0];
    let expected = impulse * twist / across();
    assert!((omega - expected).norm() < 0.03 * expected.norm(), "{omega} {expected}");
}

#[test]
fn a_heap_of_clumps_rests_and_goes_on_from_a_checkpoint() {
    let round = drop_of(150, 0.04, material(0.5, 0.1, 0.4));
    let mut long = round.clone();
    long.effects.clump = Clump { spheres: 3, aspect: 1.8 };
    let whole = start(&long).run();
    assert_eq!(whole.status, Status::AtRest, "{:?}", whole.health);
    assert_eq!(whole.positions.len(), 450);
    assert!(whole.health.worst_penetration < 0.1, "{:?}", whole.health);

    let mut first = start(&long);
    first.advance(0.15);
    let second = start(&long).resume(&first.checkpoint()).unwrap();
    assert_eq!(second.run().state_hash, whole.state_hash);
    let mut threads = start(&long).with_threads(2).unwrap();
    threads.advance(0.15);
    assert_eq!(bits(&threads), bits(&first));
    assert!(start(&round).resume(&first.checkpoint()).is_err());
}

#[test]
fn an_aspect_of_one_is_the_plain_grain_to_the_last_bit() {
    let plain = drop_of(60, 0.03, material(0.5, 0.1, 0.4));
    let mut said = plain.clone();
    said.effects.clump = Clump { spheres: 4, aspect: 1.0 };
    let after = |scene: &Scene| {
        let mut simulation = start(scene);
        simulation.advance(0.2);
        simulation
    };
    assert_eq!(bits(&after(&plain)), bits(&after(&said)));
}

#[test]
fn what_clumps_cannot_be_with_is_named() {
    let mut scene = drop_of(10, 0.05, material(0.5, 0.1, 0.5));
    scene.effects.clump = Clump { spheres: 2, aspect: 2.5 };
    let text = scene.check().unwrap_err().to_string();
    assert!(text.contains("effects.clump.aspect") && text.contains("2.5"), "{text}");
    scene.effects.clump.aspect = 1.5;
    scene.effects.polydispersity = Polydispersity { cv: 0.1, diameters: Vec::new() };
    let error = scene.check().unwrap_err();
    assert!(
        matches!(error, SceneError::Exclude { other: "effects.polydispersity", .. }),
        "{error}"
    );
}
