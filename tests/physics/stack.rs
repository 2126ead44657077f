//! Twenty spheres on top of each other: all weight in one line, the hardest chain for Gauss-Seidel.

use granulcal::dem::{Preset, Simulation, SolverSettings, Start};

use crate::scenes::{RADIUS, block, material, start};

const COUNT: usize = 20;

/// A stack whose grains touch, each off the axis by up to `aside` `[m]`.
fn stack(preset: Preset, restitution: f64, aside: f64) -> Simulation {
    let mut scene = block([1, 1, COUNT], 2.0 * RADIUS, RADIUS, material(0.5, 0.1, restitution));
    scene.preset = preset;
    let positions = (0..COUNT)
        .map(|k| {
            let (sin, cos) = (2.4 * k as f64).sin_cos(); // the golden angle: no two alike
            [aside * cos, aside * sin, RADIUS * (2 * k + 1) as f64]
        })
        .collect();
    scene.start = Start::Positions { positions };
    start(&scene)
}

/// Fastest grain and farthest way within the last three of five seconds `[m/s]`, `[m]`.
fn jitter(mut simulation: Simulation) -> (f64, f64) {
    simulation.advance(2.0);
    let rest = simulation.positions();
    let mut fastest = 0.0_f64;
    for _ in 0..300 {
        simulation.advance(0.01);
        for velocity in simulation.velocities() {
            fastest = fastest.max(velocity.norm());
        }
    }
    for (grain, now) in simulation.positions().iter().enumerate() {
        // It stands: no grain has left the axis, and overlaps have lowered it by a hundredth of a radius each at most.
        assert!(now.x.hypot(now.y) < 0.05 * RADIUS, "{now:?}");
        let height = RADIUS * (2 * grain + 1) as f64;
        assert!(height - now.z < (grain + 1) as f64 * 0.01 * RADIUS, "{now:?}");
    }
    let health = simulation.health();
    assert!(health.worst_penetration < 0.1, "{health:?}");
    let ways = simulation.positions().into_iter().zip(rest).map(|(now, then)| (now - then).norm());
    (fastest, ways.fold(0.0, f64::max))
}

#[test]
#[ignore = "missed: default and fast tremble with 0.1 m/s and fall when 1 um askew (docs/results/physics.md)"]
fn a_stack_of_twenty_stands_still() {
    for preset in [Preset::Default, Preset::Fast] {
        for e in [0.0, 0.5] {
            for aside in [0.0, 1e-6] {
                let (fastest, farthest) = jitter(stack(preset, e, aside));
                println!("{preset}, e {e}, {aside} m aside: {fastest:.1e} m/s, {farthest:.1e} m");
                assert!(fastest < 1e-5, "{preset}, e {e}, {aside} m aside: {fastest} m/s");
                assert!(farthest < 1e-2 * RADIUS, "{preset}, e {e}, {aside} m aside: {farthest} m");
            }
        }
    }
}

#[test]
fn enough_sweeps_hold_a_stack_of_twenty() {
    for preset in [Preset::Fast, Preset::Default] {
        for e in [0.0, 0.5] {
            let preset_settings = preset.settings();
            let settings =
                SolverSettings { sweeps: 60, max_sweeps: 60, settled: 1e-14, ..preset_settings };
            let upright = stack(preset, e, 0.0).with_settings(settings).expect("valid settings");
            let (fastest, farthest) = jitter(upright);
            println!("{preset}, e {e}, 60 sweeps: {fastest:.1e} m/s, {farthest:.1e} m in 3 s");
            assert!(fastest < 1e-6 && farthest < 1e-6 * RADIUS, "{preset}: {fastest} {farthest}");
            // Askew by a micrometre it leans on, by what the sweeps leave of the rolling resistance: slowly.
            let mut askew = stack(preset, e, 1e-6).with_settings(settings).expect("valid settings");
            askew.advance(1.0);
            let aside = askew.positions().iter().map(|p| p.x.hypot(p.y)).fold(0.0, f64::max);
            println!("{preset}, e {e}, 60 sweeps: from 1e-6 to {aside:.1e} m aside in 1 s");
            assert!(aside < 1e-5, "{preset}, e {e}: {aside} m aside");
        }
    }
}
