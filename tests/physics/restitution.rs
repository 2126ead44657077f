//! A grain that bounces on the ground: the speed it leaves with and the height it reaches.

use granulcal::dem::{GRAVITY, Preset, Simulation};

use crate::scenes::{RADIUS, material, one_grain, start};

/// Presets that solve a single contact exactly; see `solvers` for `paper`.
const EXACT: [Preset; 3] = [Preset::Fast, Preset::Default, Preset::Accurate];

/// Drop heights of the lowest point: 20 of them, so that impacts fall on all parts of a substep.
fn heights() -> impl Iterator<Item = f64> {
    (0..20).map(|i| 0.1 + 0.0037 * f64::from(i))
}

/// Downward speed before and velocity after the first impact, and the gap above the ground at which
/// the grain turned.
fn bounce(mut simulation: Simulation, dt: f64) -> (f64, f64, f64) {
    let mut before = 0.0;
    loop {
        let gap = simulation.positions()[0].z - RADIUS;
        simulation.advance(dt);
        let speed = simulation.velocities()[0].z;
        if speed > before - 0.5 * GRAVITY * dt {
            return (-before, speed, gap);
        }
        before = speed;
    }
}

#[test]
fn a_grain_leaves_with_e_times_its_speed() {
    for preset in EXACT {
        let dt = preset.settings().dt;
        for e in [0.0, 0.3, 0.6, 1.0] {
            for height in heights() {
                let mut scene = one_grain(RADIUS + height, material(0.5, 0.1, e));
                scene.preset = preset;
                let (before, after, _) = bounce(start(&scene), dt);
                // The impact uses the speed before the substep's gravity and replaces it: exact.
                assert!((after - e * before).abs() < 1e-12, "{preset} e {e}: {before} {after}");
            }
        }
    }
}

#[test]
fn a_bounce_is_too_high_by_no_more_than_the_gap_it_turned_at() {
    for preset in EXACT {
        let dt = preset.settings().dt;
        for (number, e) in [0.0, 0.3, 0.6, 1.0].into_iter().enumerate() {
            let mut worst = 0.0_f64;
            for height in heights() {
                let mut scene = one_grain(RADIUS + height, material(0.5, 0.1, e));
                scene.preset = preset;
                let (before, after, gap) = bounce(start(&scene), dt);
                let energy = |v: f64, gap: f64| 0.5 * v * v + GRAVITY * gap;
                let realised = (energy(after, gap) / energy(before, gap)).sqrt();
                // The grain turns up to one substep's way above the ground, so that
                // e_realised^2 <= e^2 + 2 g gap / v^2 with gap < v dt.
                let bound = (e * e + 2.0 * GRAVITY * dt / before).sqrt();
                assert!(realised <= bound + 1e-12, "{preset} e {e}: {realised} above {bound}");
                worst = worst.max((realised - e).abs());
            }
            // Measured over the heights: fast 0.106, 0.017, 0.006; default 0.070, 0.007, 0.003; accurate
            // 0.033, 0.002, 0.001; and 0 at e = 1.
            let tolerances = match preset {
                Preset::Fast => [0.12, 0.02, 0.008, 1e-12],
                Preset::Default => [0.08, 0.009, 0.004, 1e-12],
                Preset::Accurate | Preset::Paper => [0.04, 0.003, 0.001, 1e-12],
            };
            let tolerance = tolerances[number];
            assert!(worst < tolerance, "{preset} e {e}: {worst}");
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
