//! The three solver methods on frozen substeps and on whole pours.
//!
//! Tolerances stand beside what was measured; docs/theory/solvers.md has the methods.

use granulcal_dem::{
    Complementarity, FrozenSolution, FrozenSolve, GRAVITY, MAX_ENERGY_CREATED, Material, Method,
    NewtonSettings, Preset, ReferenceSettings, Scene, Simulation, SolverSettings, Start,
};
use nalgebra::Vector3;
use proptest::prelude::*;

const EQUATIONS: [Complementarity; 2] =
    [Complementarity::FischerBurmeister, Complementarity::MinMap];

/// Exactly so many Gauss-Seidel sweeps, plain ones: those over-relaxed by 1.4 end in a cycle (docs/theory/solvers.md).
fn gauss_seidel(sweeps: usize) -> SolverSettings {
    let (settled, closing) = (f64::MIN_POSITIVE, f64::MAX);
    let base = Preset::Paper.settings();
    let max_sweeps = sweeps + 1;
    SolverSettings {
        method: Method::Nsgs,
        sweeps,
        relaxation: 1.0,
        settled,
        max_sweeps,
        closing,
        ..base
    }
}

fn newton(outer: usize, inner: usize, complementarity: Complementarity) -> SolverSettings {
    let newton = NewtonSettings { outer, inner, complementarity, ..NewtonSettings::default() };
    SolverSettings { newton, ..Preset::Paper.settings() }
}

fn reference(residual: f64) -> SolverSettings {
    let reference = ReferenceSettings { residual, ..ReferenceSettings::default() };
    SolverSettings { method: Method::Reference, reference, ..Preset::Paper.settings() }
}

fn solve(problem: &FrozenSolve, settings: &SolverSettings) -> FrozenSolution {
    problem.solve(settings).expect("valid settings")
}

/// Root mean square of a list of vectors.
fn rms(vectors: impl Iterator<Item = Vector3<f64>>) -> f64 {
    let (mut square, mut count) = (0.0, 0);
    for vector in vectors {
        square += vector.norm_squared();
        count += 1;
    }
    (square / f64::from(count)).sqrt()
}

/// Rms difference of the velocities and spins of two solutions over the rms velocity of the second.
fn difference(a: &FrozenSolution, b: &FrozenSolution) -> f64 {
    let both = |s: &FrozenSolution| [s.velocities.clone(), s.spins.clone()].concat();
    let (a, b) = (both(a), both(b));
    rms(a.iter().zip(&b).map(|(a, b)| a - b)) / rms(b.into_iter())
}

/// A column of 20 grains, each on the one below, without impulses to start from.
fn column() -> FrozenSolve {
    let mut scene = Scene::drop(0.0);
    // A picometre apart: a gap that rounding makes negative would be let sink into its slop.
    let (counts, apart) = ([1, 1, 20], 1e-12);
    let radius = scene.grains.radius();
    scene.grains.count = 20;
    scene.preset = Preset::Paper;
    scene.start =
        Start::Grid { counts, spacing: 2.0 * radius + apart, jitter: 0.0, base: radius + apart };
    Simulation::new(&scene, 1).expect("a valid scene").frozen_solve().expect("balls")
}

/// A heap of 80 grains as it falls apart, with the impulses of the substep before.
fn heap() -> FrozenSolve {
    heap_of(0.5, 0.2, 0.1)
}

/// Of grains of these frictions, this time after it was let go `[s]`: at some moments contacts lock, and no method
/// ends.
fn heap_of(sliding: f64, rolling: f64, seconds: f64) -> FrozenSolve {
    let mut scene = Scene::drop(0.01);
    scene.grains.count = 80;
    scene.preset = Preset::Paper;
    scene.material = Material::new(sliding, rolling, 0.3).expect("a valid material");
    let pour = Simulation::new(&scene, 1).expect("a valid scene");
    let mut pour = pour.with_settings(gauss_seidel(40)).expect("valid settings");
    pour.advance(seconds);
    pour.frozen_solve().expect("balls")
}

#[test]
fn a_column_carries_its_weight() {
    // Contact k from the top carries k grains: sum k g dt over 20 contacts, and nothing moves.
    let problem = column();
    let weight = GRAVITY / 600.0;
    let expected = 210.0 * weight;
    let cases = [
        (gauss_seidel(5000), 1e-4),
        (reference(1e-8), 1e-4),
        (newton(40, 40, Complementarity::FischerBurmeister), 1e-4),
        (newton(40, 40, Complementarity::MinMap), 1e-4),
    ];
    for (settings, tolerance) in cases {
        let solution = solve(&problem, &settings);
        let error = (solution.normal_impulse / expected - 1.0).abs();
        let speed = rms(solution.velocities.iter().copied());
        assert!(error < tolerance, "{}: {error}", settings.method);
        assert!(speed < tolerance * weight, "{}: {speed}", settings.method);
    }
}

#[test]
fn the_methods_agree_on_a_heap() {
    let problem = heap();
    assert!(problem.contact_count() > 100, "{}", problem.contact_count());
    let exact = solve(&problem, &reference(1e-10));
    // Measured 1.0e-4, 2.0e-11, 1.0e-7, 1.9e-3, 6.8e-3, 1.0e-10 and 8.0e-11.
    let cases = [
        (gauss_seidel(20), 2e-3),
        (gauss_seidel(20_000), 1e-8),
        (reference(1e-6), 2e-5),
        (newton(4, 20, Complementarity::FischerBurmeister), 0.04),
        (newton(4, 20, Complementarity::MinMap), 0.04),
        (newton(200, 20, Complementarity::FischerBurmeister), 1e-4),
        (newton(200, 20, Complementarity::MinMap), 1e-4),
    ];
    for (settings, tolerance) in cases {
        let solution = solve(&problem, &settings);
        let error = difference(&solution, &exact);
        assert!(error < tolerance, "{}: {error}", settings.method);
    }
}

#[test]
fn the_reference_meets_its_residual_or_says_so() {
    let problem = heap();
    for residual in [1e-2, 1e-4, 1e-6, 1e-10] {
        let solution = solve(&problem, &reference(residual));
        assert!(!solution.unconverged && solution.residual <= residual, "{solution:?}");
    }
    let mut settings = reference(1e-10);
    settings.reference.max_sweeps = 16;
    let solution = solve(&problem, &settings);
    assert!(solution.unconverged && solution.residual > 1e-10);
    assert_eq!(solution.sweeps, 16);
}

#[test]
fn conjugate_directions_save_sweeps() {
    let problem = heap_of(0.5, 0.2, 0.12);
    let solution = solve(&problem, &reference(1e-8));
    let sweeps = solve(&problem, &gauss_seidel(solution.sweeps));
    println!(
        "{} sweeps: {:.1e} against {:.1e}",
        solution.sweeps, solution.residual, sweeps.residual
    );
    // Measured: 136 sweeps leave 9.5e-9 with and 1.5e-4 without.
    assert!(sweeps.residual > 100.0 * solution.residual, "{}", sweeps.residual);
}

#[test]
fn over_relaxed_sweeps_meet_the_solution_up_to_a_limit() {
    // Rough grains, whose contacts lock.
    let problem = heap_of(0.9, 0.5, 0.12);
    let relative = |relaxation| {
        let settings = SolverSettings { relaxation, ..gauss_seidel(20_000) };
        solve(&problem, &settings).residual
    };
    // Measured: 1e-16 with 1 and 1.2; 3e-3 with 1.4 and 2e-2 with 1.6, where they circle.
    let [one, less, more, most] = [1.0, 1.2, 1.4, 1.6].map(relative);
    println!("{one:.1e} {less:.1e} {more:.1e} {most:.1e}");
    assert!(one < 1e-10, "{one:e}");
    // What is over-relaxed too far does not end at the solution, and the further the worse.
    assert!(less < more && more < most && most < 1.0, "{less:e} {more:e} {most:e}");
    assert!(more > 1e-5, "{more:e}");
}

#[test]
fn settings_that_iterate_nothing_are_refused() {
    let problem = column();
    let refused = |settings: &SolverSettings, name: &str| {
        let error = problem.solve(settings).expect_err("nothing to iterate").to_string();
        assert!(error.contains(name), "{error}");
    };
    refused(&newton(0, 20, Complementarity::MinMap), "newton.outer");
    refused(&newton(4, 0, Complementarity::MinMap), "newton.inner");
    refused(&reference(0.0), "reference.residual");
    let mut settings = Preset::Paper.settings();
    settings.newton.relaxation = f64::NAN;
    refused(&settings, "newton.relaxation");
}

/// 40 grains from 5 cm, for the time of the fall and of the first impacts.
fn small_drop(grains: Material, settings: SolverSettings, seed: u64) -> Simulation {
    let mut scene = Scene::drop(0.05);
    scene.grains.count = 40;
    scene.material = grains;
    let drop = Simulation::new(&scene, seed).expect("a valid scene");
    let mut drop = drop.with_settings(settings).expect("valid settings");
    drop.advance(0.25);
    drop
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

    /// The whole prior: 4 x 20 is finite and does not explode, with either equation.
    #[test]
    fn newton_is_finite_over_the_prior(
        mu_s in 0f64..=1.0, log_mu_r in -3f64..=0.0, e in 0f64..=1.0, seed in 0u64..1000,
    ) {
        let grains = Material::new(mu_s, 10f64.powf(log_mu_r), e).expect("a valid material");
        for complementarity in EQUATIONS {
            let drop = small_drop(grains, newton(4, 20, complementarity), seed);
            let finite = |vectors: &[Vector3<f64>]| vectors.iter().all(|v| v.iter().all(|c| c.is_finite()));
            prop_assert!(finite(&drop.positions()) && finite(&drop.velocities()));
            // Falling 5 cm gives 1 m/s. Of 6000 pours the fastest had 1.7 m/s, the worst had created 6e-4.
            let fastest = drop.velocities().iter().map(Vector3::norm).fold(0.0, f64::max);
            let health = drop.health();
            prop_assert!(fastest < 3.0, "{fastest} {health:?}");
            prop_assert!(health.energy_created < MAX_ENERGY_CREATED, "{complementarity:?} {health:?}");
            prop_assert!(health.grains_lost == 0);
        }
    }
}
