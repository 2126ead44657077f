//! A grain that bounces on the ground: the speed it leaves with and the height it reaches.

use granulcal::dem::{GRAVITY, Scene, Simulation, SolverSettings};

use crate::scenes::{RADIUS, material, one_grain, start};

/// Kinetic and potential energy of the grain per mass, from the ground up. Positions are those of an exact
/// parabola, velocities those of half a substep earlier (leapfrog).
fn energy(simulation: &Simulation, dt: f64) -> f64 {
    let speed = simulation.velocities()[0].z - 0.5 * GRAVITY * dt;
    0.5 * speed * speed + GRAVITY * (simulation.positions()[0].z - RADIUS)
}

/// Realised restitution of the first impact: the root of the energies after and before it.
fn realised(scene: &Scene, dt: f64) -> f64 {
    let settings = SolverSettings { dt, ..scene.settings() };
    let mut simulation = start(scene).with_settings(settings).expect("valid settings");
    let before = energy(&simulation, -dt);
    let mut speed = 0.0;
    while simulation.velocities()[0].z <= speed {
        speed = simulation.velocities()[0].z;
        simulation.advance(dt);
    }
    let after = energy(&simulation, dt);
    // The solver leaves resting contacts within 20 micrometres: so high is no rebound of an inelastic grain.
    let stays = scene.material.restitution == 0.0 && after < GRAVITY * 2e-5;
    if stays { 0.0 } else { (after / before).sqrt() }
}

#[test]
fn a_bounce_that_gives_all_back_creates_no_energy() {
    for height in [0.005, 0.02, 0.1] {
        let mut simulation = start(&one_grain(RADIUS + height, material(0.5, 0.1, 1.0)));
        simulation.advance(1.0);
        let created = simulation.health().energy_created;
        assert!(created < 1e-3, "{height}: {created}");
    }
}

#[test]
fn restitution_is_realised_at_any_speed_and_substep() {
    for substeps in [5, 10, 20, 40] {
        let dt = 1.0 / (60.0 * f64::from(substeps));
        for speed in [0.1, 0.3, 1.0, 2.0, 5.0] {
            for e in [0.0, 0.1, 0.3, 0.5, 0.8, 0.95, 1.0] {
                for phase in 0..5 {
                    // Impacts on all parts of a substep.
                    let height =
                        0.5 * speed * speed / GRAVITY + f64::from(phase) * 0.23 * speed * dt;
                    let scene = one_grain(RADIUS + height, material(0.5, 0.1, e));
                    let error = realised(&scene, dt) - e;
                    // A rebound that is over within a substep is contact.
                    let lasts = 2.0 * e * speed / GRAVITY > dt || e == 0.0;
                    assert!(!lasts || error.abs() < 1e-3, "{substeps} {speed} e {e}: {error}");
                }
            }
        }
    }
}

#[test]
fn slow_impacts_do_not_bounce() {
    // 0.05 m/s is the threshold: a drop of 0.1 mm arrives with 0.044 m/s.
    let scene = one_grain(RADIUS + 1e-4, material(0.5, 0.1, 1.0));
    let mut simulation = start(&scene);
    simulation.advance(0.1);
    assert!(simulation.velocities()[0].z.abs() < 1e-12);
    assert!((simulation.positions()[0].z - RADIUS).abs() < 1.1e-5); // the slop of 0.01 mm
}
