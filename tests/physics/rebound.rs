//! How high a grain bounces: restitution as it shows in the positions.
//!
//! Substeps are symplectic Euler, v += dt g before x += dt v: positions lie on the exact parabola, and the stored
//! velocity is that of half a substep earlier. Two positions in flight therefore give the height to rounding, and with
//! it e = sqrt(2 g h') / v, v the speed at the moment of touch.

use granulcal::dem::{GRAVITY, Preset, SolverSettings};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, material, one_grain, start};

/// Whole substeps of fall before the one in which the grain touches.
const FALL: f64 = 5.0;

/// The restitution that shows in the height after an impact of `speed`, `phase` of a substep after its beginning;
/// nothing if the flight is too short for two positions.
fn realised(e: f64, speed: f64, substeps: u32, phase: f64) -> Option<f64> {
    let dt = 1.0 / (60.0 * f64::from(substeps));
    if e > 0.0 && 2.0 * e * speed / GRAVITY < 3.0 * dt {
        return None;
    }
    let time = (FALL + phase) * dt;
    let downwards = speed - GRAVITY * time;
    let gap = downwards * time + 0.5 * GRAVITY * time * time;
    let settings = SolverSettings { dt, ..Preset::Default.settings() };
    let scene = one_grain(RADIUS + gap, material(0.5, 0.1, e));
    let mut simulation = start(&scene).with_settings(settings).expect("valid settings");
    let velocity = Vector3::new(0.0, 0.0, -downwards + 0.5 * GRAVITY * dt);
    simulation.set_motion(0, velocity, Vector3::zeros()).expect("a valid motion");

    simulation.advance((FALL + 1.0) * dt);
    let first = simulation.positions()[0].z - RADIUS;
    simulation.advance(dt);
    let second = simulation.positions()[0].z - RADIUS;
    if e == 0.0 {
        return Some((2.0 * GRAVITY * first.max(second).max(0.0)).sqrt() / speed);
    }
    let upwards = (second - first) / dt + 0.5 * GRAVITY * dt;
    let height = first + upwards * upwards / (2.0 * GRAVITY);
    Some((2.0 * GRAVITY * height).sqrt() / speed)
}

#[test]
fn a_grain_bounces_to_e_squared_of_its_height() {
    let (mut worst, mut measured) = (0.0_f64, 0);
    for substeps in [5, 10, 20, 40] {
        for speed in [0.1, 0.2, 0.5, 1.0, 2.0, 5.0] {
            for tenths in 0..=10 {
                let e = 0.1 * f64::from(tenths);
                for phase in [0.02, 0.2, 0.4, 0.6, 0.8, 0.98] {
                    let Some(found) = realised(e, speed, substeps, phase) else { continue };
                    let error = (found - e).abs();
                    assert!(error < 1e-3, "{substeps}, {speed} m/s, e {e}, {phase}: {found}");
                    worst = worst.max(error);
                    measured += 1;
                }
            }
        }
    }
    println!("{measured} bounces, worst {worst:.1e}");
    assert!(measured > 1000, "{measured}");
}
