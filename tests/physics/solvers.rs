//! Pours by the other two methods: the preset `paper` (Newton) and the reference.
//!
//! Four Newton steps of 0.75 leave a share of every change unsolved; the warm start makes up for it in what lasts.

use granulcal::dem::{
    GRAVITY, MAX_ENERGY_CREATED, Method, Preset, ReferenceSettings, SolverSettings, Start, Status,
};

use crate::scenes::{RADIUS, bits, block, drop_of, material, motion, one_grain, start};

fn reference(residual: f64) -> SolverSettings {
    let reference = ReferenceSettings { residual, ..ReferenceSettings::default() };
    SolverSettings { method: Method::Reference, reference, ..Preset::Default.settings() }
}

#[test]
fn impacts_are_none_of_the_methods_business() {
    let paper = Preset::Paper.settings();
    for e in [0.3, 0.6, 1.0] {
        for step in 0..10 {
            let height = 0.1 + 0.0037 * f64::from(step);
            let scene = one_grain(RADIUS + height, material(0.5, 0.1, e));
            let by = |method| {
                let settings = SolverSettings { method, ..paper };
                let simulation = start(&scene).with_settings(settings);
                let mut simulation = simulation.expect("valid settings");
                // To the substep of the first impact.
                let fall = (2.0 * height / GRAVITY).sqrt();
                simulation.advance((fall / paper.dt).ceil() * paper.dt);
                simulation
            };
            let newton = by(Method::NewtonPcr);
            assert!(newton.velocities()[0].z > 0.0, "{:?}", newton.velocities());
            assert_eq!(bits(&newton), bits(&by(Method::Nsgs)), "e {e}, {height} m");
        }
    }
}

#[test]
fn a_slow_landing_stays_within_the_slop() {
    for step in 1..10 {
        // Too slow for an impact: four steps stop it, without impulses to start from, to 2.4 % of 0.08 mm a substep.
        let height = 1e-5 * f64::from(step);
        let mut scene = one_grain(RADIUS + height, material(0.5, 0.1, 0.5));
        scene.preset = Preset::Paper;
        let mut simulation = start(&scene);
        simulation.advance(0.1);
        let sunk = simulation.health().worst_penetration * RADIUS;
        assert!(sunk < 1e-5, "{height}: {sunk}");
        assert!(simulation.velocities()[0].norm() < 1e-6, "{:?}", simulation.velocities());
    }
}

#[test]
fn a_grain_rolls_at_five_sevenths_by_newton() {
    let (tangent, rolling_friction, time) = (0.3_f64, 0.1, 0.2);
    let (sin, cos) = tangent.atan().sin_cos();
    let mut scene = one_grain(RADIUS, material(0.5, rolling_friction, 0.5));
    scene.preset = Preset::Paper;
    scene.gravity = [GRAVITY * sin, 0.0, -GRAVITY * cos];
    let mut simulation = start(&scene);
    simulation.advance(time);
    let begin = motion(&simulation, 0);
    simulation.advance(time);
    let grain = motion(&simulation, 0);
    let expected = 5.0 / 7.0 * GRAVITY * (sin - rolling_friction * cos) * time;
    // From the second half alone: the warm start has made up for the unfinished first solves.
    assert!(((grain.v.x - begin.v.x) / expected - 1.0).abs() < 1e-9);
    assert!((grain.w.y / grain.v.x - 1.0).abs() < 1e-9); // no slip
}

#[test]
fn a_column_stands_by_newton() {
    let mut scene = block([1, 1, 10], 2.0 * RADIUS + 1e-5, RADIUS + 1e-5, material(0.5, 0.1, 0.0));
    scene.preset = Preset::Paper;
    let mut simulation = start(&scene);
    simulation.advance(1.0);
    let top = simulation.positions()[9].z;
    simulation.advance(1.0);
    assert!((simulation.positions()[9].z - top).abs() < 1e-9);
    // Ten contacts, each within its slop of 0.01 mm of touching.
    assert!((top - 19.0 * RADIUS).abs() < 10.0 * 1.1e-5, "{top}");
}

#[test]
fn a_pile_by_the_papers_solver_is_healthy() {
    let mut scene = drop_of(200, 0.05, material(0.5, 0.3, 0.5));
    scene.preset = Preset::Paper;
    let pour = start(&scene).run();
    assert_eq!(pour.status, Status::AtRest);
    assert!(pour.health.energy_created < MAX_ENERGY_CREATED);
    // The guard acts, on one or two of the four steps in a substep: 331 in 245 substeps when measured.
    assert!(pour.health.guarded > 0 && pour.health.guarded < 2 * pour.health.substeps);
}

#[test]
fn a_pour_by_the_reference_is_that_of_many_sweeps() {
    // A block on a steep ground as it begins to give way, before anything is fast enough for an impact: the
    // order of impacts amplifies rounding to whole ways.
    let (counts, spacing, base) = ([5, 4, 3], 4.002e-3, 2.002e-3);
    let mut scene = block(counts, spacing, base, material(0.5, 0.3, 0.3));
    scene.start = Start::Grid { counts, spacing, jitter: 5e-7, base };
    scene.gravity = [0.7 * GRAVITY, 0.1 * GRAVITY, -0.7 * GRAVITY];
    let by = |settings| {
        let mut simulation = start(&scene).with_settings(settings).expect("valid settings");
        simulation.advance(9.0 * Preset::Default.settings().dt);
        simulation
    };
    let (sweeps, settled) = (4000, f64::MIN_POSITIVE);
    let base = Preset::Default.settings();
    let sweeps = SolverSettings { sweeps, settled, max_sweeps: sweeps, ..base };
    let exact = by(sweeps);
    // Farthest grain, measured: 8.0e-11, 7.7e-13 and 3.1e-15 m.
    for (residual, tolerance) in [(1e-5, 1e-9), (1e-7, 1e-11), (1e-9, 1e-12)] {
        let pour = by(reference(residual));
        assert_eq!(pour.health().unconverged, 0);
        assert!(pour.health().mean_contacts > 100.0, "{:?}", pour.health());
        assert!(pour.health().worst_residual <= residual);
        let (got, wanted) = (pour.positions(), exact.positions());
        let apart = got.iter().zip(&wanted).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!(apart < tolerance, "{residual}: {apart}");
    }
}

#[test]
fn threads_do_not_change_a_bit_of_either_method() {
    // As in `determinism`: enough contacts of a colour for threads to share a sweep.
    let (counts, spacing, base) = ([24, 24, 24], 4.05e-3, 2.1e-3);
    let mut scene = block(counts, spacing, base, material(0.5, 0.1, 0.5));
    scene.start = Start::Grid { counts, spacing, jitter: 1e-5, base };
    let newton = Preset::Paper.settings();
    for settings in [newton, SolverSettings { dt: newton.dt, ..reference(1e-3) }] {
        let after = |threads| {
            let simulation = start(&scene).with_settings(settings).expect("valid settings");
            let mut simulation = simulation.with_threads(threads).expect("threads");
            simulation.advance(12.0 / 600.0);
            simulation
        };
        let alone = after(1);
        assert!(alone.health().mean_contacts > 7.0 * 512.0 * 8.0, "{:?}", alone.health());
        assert!(bits(&after(3)) == bits(&alone), "{}", settings.method);
    }
}
