//! Space that repeats: it is the same wherever its end is put, and what crosses the end is not changed by it.

use granulcal::dem::{GRAVITY, Periodic, PeriodicAxis, Preset, Scene, Simulation, Start};
use nalgebra::Vector3;

use crate::scenes::{RADIUS, bits, block, material, one_grain, start};

const LENGTH: f64 = 0.032;

fn periodic(axis: PeriodicAxis, from: f64) -> Periodic {
    Periodic { axis, from, to: from + LENGTH }
}

/// 192 grains that fall onto the ground and against each other, 2 layers of 12 x 8, all around a period along y.
fn falling(shift: f64, restitution: f64) -> Scene {
    let mut scene = block([12, 8, 2], 4e-3, 0.0, material(0.4, 0.1, restitution));
    let place = |n: usize| {
        let (x, y, z) = (n % 12, n / 12 % 8, n / 96);
        // Not a lattice: every other row is shifted, every third grain is higher.
        let at = Vector3::new(
            4.1e-3 * x as f64 + 1.3e-3 * (y % 2) as f64,
            4e-3 * y as f64,
            4e-3 + 4.2e-3 * z as f64 + 0.7e-3 * (n % 3) as f64,
        );
        [at.x, (at.y + shift).rem_euclid(LENGTH), at.z]
    };
    scene.start = Start::Positions { positions: (0..192).map(place).collect() };
    scene.periodic = Some(periodic(PeriodicAxis::Y, 0.0));
    scene
}

/// Positions after `seconds`, with y as it was before the shift.
fn after(scene: &Scene, shift: f64, seconds: f64) -> (Vec<Vector3<f64>>, Simulation) {
    let mut simulation = start(scene);
    simulation.advance(seconds);
    let back = |mut x: Vector3<f64>| {
        x.y = (x.y - shift).rem_euclid(LENGTH);
        x
    };
    (simulation.positions().into_iter().map(back).collect(), simulation)
}

#[test]
fn where_the_end_is_put_changes_nothing() {
    for restitution in [0.0, 0.6] {
        let (expected, whole) = after(&falling(0.0, restitution), 0.0, 0.03);
        assert!(whole.health().mean_contacts > 300.0, "{:?}", whole.health());
        for shift in [0.25 * LENGTH, 0.61 * LENGTH] {
            let (found, _) = after(&falling(shift, restitution), shift, 0.03);
            let apart = |(a, b): (&Vector3<f64>, &Vector3<f64>)| {
                let d = a - b;
                Vector3::new(d.x, d.y - LENGTH * (d.y / LENGTH).round(), d.z).norm()
            };
            let worst = expected.iter().zip(&found).map(apart).fold(0.0, f64::max);
            // Another order of contacts: four sweeps leave a few micrometres of difference, chaos has no time yet.
            assert!(worst < 2e-5, "e {restitution}, shift {shift}: {worst}");
        }
    }
}

#[test]
fn grains_meet_across_the_end_as_elsewhere() {
    // Head on at 2 x 0.2 m/s, e = 0.5: they part with 0.1 m/s each, wherever they meet.
    for (axis, number) in [(PeriodicAxis::X, 0), (PeriodicAxis::Y, 1)] {
        for middle in [0.0, 0.5 * LENGTH] {
            let mut scene = one_grain(0.0, material(0.0, 0.0, 0.5));
            scene.grains.count = 2;
            scene.gravity = [0.0; 3];
            scene.periodic = Some(periodic(axis, -0.5 * LENGTH));
            let place = |sign: f64| {
                let mut at = [0.0, 0.0, 0.1];
                at[number] = middle + sign * 3.0 * RADIUS;
                at[number] -= LENGTH * (at[number] / LENGTH).round();
                at
            };
            scene.start = Start::Positions { positions: vec![place(-1.0), place(1.0)] };
            let mut simulation = start(&scene);
            for (grain, sign) in [(0, 1.0), (1, -1.0)] {
                let mut velocity = Vector3::zeros();
                velocity[number] = sign * 0.2;
                simulation.set_motion(grain, velocity, Vector3::zeros()).unwrap();
            }
            simulation.advance(0.03);
            let along: Vec<_> = simulation.velocities().iter().map(|v| v[number]).collect();
            assert!((along[0] + 0.1).abs() < 1e-12 && (along[1] - 0.1).abs() < 1e-12, "{along:?}");
        }
    }
}

#[test]
fn a_slope_without_end_keeps_its_energy() {
    // A grain slides down 20 deg of smooth ground, ten times around: v = g sin a t, and no energy is created.
    let slope = 20f64.to_radians();
    let mut scene = one_grain(RADIUS, material(0.0, 0.0, 0.0));
    scene.gravity = [GRAVITY * slope.sin(), 0.0, -GRAVITY * slope.cos()];
    scene.periodic = Some(periodic(PeriodicAxis::X, -0.5 * LENGTH));
    let mut simulation = start(&scene);
    simulation.advance(0.5);
    let speed = simulation.velocities()[0].x;
    assert!((speed / (0.5 * GRAVITY * slope.sin()) - 1.0).abs() < 1e-9, "{speed}");
    assert!(simulation.health().energy_created < 1e-9, "{:?}", simulation.health());
    assert!(simulation.positions()[0].x.abs() <= 0.5 * LENGTH);
}

#[test]
fn same_bits_on_any_threads_and_after_a_restart() {
    let scene = falling(0.0, 0.5);
    let (_, whole) = after(&scene, 0.0, 0.02);
    let mut shared = start(&scene).with_threads(3).unwrap();
    shared.advance(0.02);
    assert!(bits(&whole) == bits(&shared));
    let mut first = start(&scene);
    first.advance(0.0113);
    let mut second = start(&scene).resume(&first.checkpoint()).unwrap();
    while second.time() < 0.02 - 1e-9 {
        second.advance(scene.settings().dt);
    }
    assert!(bits(&whole) == bits(&second));
}

#[test]
fn a_bed_settles_to_rest_in_every_preset() {
    for preset in [Preset::Fast, Preset::Default] {
        let mut scene = falling(0.3 * LENGTH, 0.3);
        scene.preset = preset;
        scene.end.horizon = 2.0;
        scene.end.kinetic_energy = 1e-8;
        let pour = start(&scene).run();
        assert_eq!(pour.status.name(), "at_rest", "{preset} {:?}", pour.health);
        assert!(pour.positions.iter().all(|x| (0.0..LENGTH).contains(&x.y)));
    }
}

#[test]
fn a_period_too_short_for_the_grains_is_refused() {
    let mut scene = falling(0.0, 0.5);
    scene.periodic = Some(Periodic { axis: PeriodicAxis::Y, from: 0.0, to: 7.9 * RADIUS });
    let said = Simulation::new(&scene, 1).unwrap_err().to_string();
    assert!(
        said.contains("periodic.to") && said.contains("4 diameters of the widest grain"),
        "{said}"
    );
}
