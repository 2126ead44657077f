//! Impacts on grains that touch others, against springs and dashpots integrated finely.

use granulcal::dem::{Preset, Scene, Simulation, SolverSettings, Start};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, material, one_grain, start};

/// A row of point masses that touch, the first touching a wall, struck at the far end with speed 1: linear springs of
/// one stiffness and dashpots that never pull, semi-implicit steps of 1e-3 / omega. Returns the velocities at the end,
/// the striker's last.
fn springs(count: usize, restitution: f64) -> Vec<f64> {
    let beta = damping(restitution);
    // Contact 0 is at the wall: reduced mass 1, else 1/2, so that all contacts last equally long.
    let mass = |contact: usize| if contact == 0 { 1.0 } else { 0.5 };
    let (mut x, mut v) = (vec![0.0; count + 1], vec![0.0; count + 1]);
    v[count] = -1.0;
    let step = 1e-3;
    for _ in 0..200_000 {
        let mut force = vec![0.0; count + 1];
        for contact in 0..=count {
            let below = |of: &[f64]| if contact == 0 { 0.0 } else { of[contact - 1] };
            let (d, s) = (below(&x) - x[contact], below(&v) - v[contact]);
            if d > 0.0 {
                let push = mass(contact) * (d + 2.0 * beta * s).max(0.0);
                force[contact] += push;
                if contact > 0 {
                    force[contact - 1] -= push;
                }
            }
        }
        for n in 0..=count {
            v[n] += step * force[n];
            x[n] += step * v[n];
        }
    }
    v
}

/// beta of a restitution, by bisection on the closed form.
fn damping(restitution: f64) -> f64 {
    let of = |beta: f64| {
        let ratio = if beta < 1.0 {
            beta.acos() / (1.0 - beta * beta).sqrt()
        } else {
            beta.acosh() / (beta * beta - 1.0).sqrt()
        };
        (-2.0 * beta * ratio).exp()
    };
    let (mut low, mut high) = (0.0, 100.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if of(middle) > restitution { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

/// The same row in the simulator, weightless: velocities after the blow, the striker's last.
fn column(count: usize, restitution: f64, preset: Preset) -> Vec<f64> {
    let mut scene: Scene = one_grain(1.0, material(0.0, 0.0, restitution));
    scene.gravity = [0.0; 3];
    scene.grains.count = count + 1;
    let dt = preset.settings().dt;
    let height = |n: usize| RADIUS * (2 * n + 1) as f64 + if n == count { 1.6 * dt } else { 0.0 };
    scene.start =
        Start::Positions { positions: (0..=count).map(|n| [0.0, 0.0, height(n)]).collect() };
    let settings = SolverSettings { max_penetration: 0.1, ..preset.settings() };
    let mut simulation: Simulation = start(&scene).with_settings(settings).expect("valid settings");
    simulation.set_motion(count, Vector3::new(0.0, 0.0, -1.0), Vector3::zeros()).expect("valid");
    simulation.advance(6.0 * dt);
    simulation.velocities().iter().map(|v| v.z).collect()
}

fn energy(velocities: &[f64]) -> f64 {
    velocities.iter().map(|v| v * v).sum()
}

#[test]
fn a_blow_on_a_column_is_handed_on_as_springs_do() {
    for count in [1, 2, 4, 8] {
        for e in [0.0, 0.3, 0.6, 0.9, 1.0] {
            let expected = springs(count, e);
            for (preset, tolerance) in [(Preset::Accurate, 0.03), (Preset::Default, 0.08)] {
                let got = column(count, e, preset);
                let error = energy(&got) - energy(&expected);
                println!(
                    "{preset} N {count} e {e}: energy {:.3} springs {:.3}, striker {:.3} springs {:.3}",
                    energy(&got),
                    energy(&expected),
                    got[count],
                    expected[count]
                );
                assert!(error.abs() < tolerance, "{preset}, {count} grains, e {e}: {error}");
            }
        }
    }
}
