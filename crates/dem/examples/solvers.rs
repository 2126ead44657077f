//! Residual against cost of the three solver methods, on frozen substeps of the paper's funnel.
//!
//!     cargo run --release -p granulcal-dem --example solvers
//!     cargo run --release -p granulcal-dem --example solvers -- pours    # whole pours
//!
//! Prints the tables of docs/theory/solvers.md. A pour of 2000 grains is simulated with Gauss-Seidel sweeps to 0.3 s
//! (the funnel is full) and to 0.6 s (the pile grows); the contact problem of the next substep is then solved by each
//! method from the same warm impulses. Times are CPU times, the best of a few repetitions.

use std::time::Duration;

use cpu_time::ThreadTime;
use granulcal_dem::{
    Complementarity, DemError, FrozenSolution, FrozenSolve, Health, Material, Method,
    NewtonSettings, Preset, ReferenceSettings, Scene, Simulation, SolverSettings,
};
use nalgebra::Vector3;

/// Times at which a substep is frozen `[s]`.
const TIMES: [f64; 2] = [0.3, 0.6];
/// Solves of which the fastest counts.
const REPETITIONS: usize = 5;

fn main() -> Result<(), DemError> {
    if std::env::args().any(|argument| argument == "pours") {
        return pours();
    }
    for dt in [1.0 / 600.0, 1.0 / 2000.0] {
        table(dt)?;
    }
    Ok(())
}

/// Prints the table of whole pours through the funnel, to rest.
fn pours() -> Result<(), DemError> {
    println!(
        "| mu_s, mu_r, e | settings | mean z mm | mean r mm | CPU s | worst penetration / R | mean residual | guarded | energy created | lost |"
    );
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for [mu_s, mu_r, e] in [[0.5, 0.2, 0.5], [0.8, 0.2, 0.77], [0.3, 0.2, 0.1]] {
        let paper = Preset::Paper.settings();
        let settings = [
            ("`default`", Preset::Default.settings()),
            ("`paper`", paper),
            ("`paper` by nsgs, 40 sweeps", gauss_seidel(40, paper)),
        ];
        for (name, settings) in settings {
            let material = Material::new(mu_s, mu_r, e)?;
            let scene = Scene { material, ..Scene::funnel(0.12) };
            let start = ThreadTime::now();
            let pour = Simulation::new(&scene, 1)?.with_settings(settings)?.run();
            let seconds = start.elapsed().as_secs_f64();
            let count = pour.positions.len() as f64;
            let mean = |of: &dyn Fn(&Vector3<f64>) -> f64| {
                1e3 * pour.positions.iter().map(of).sum::<f64>() / count
            };
            let (z, r) = (mean(&|at| at.z), mean(&|at| at.x.hypot(at.y)));
            let Health {
                worst_penetration,
                mean_residual,
                guarded,
                substeps,
                energy_created,
                grains_lost,
                ..
            } = pour.health;
            println!(
                "| {mu_s}, {mu_r}, {e} | {name}: {} | {z:.2} | {r:.1} | {seconds:.1} | {worst_penetration:.2} | {mean_residual:.3} | {guarded} in {substeps} substeps | {energy_created:.1e} | {grains_lost} |",
                pour.status
            );
        }
    }
    Ok(())
}

/// Prints the table for substeps of `dt` seconds.
fn table(dt: f64) -> Result<(), DemError> {
    let sweeps = SolverSettings { dt, ..gauss_seidel(20, Preset::Paper.settings()) };
    let mut scene = Scene::funnel(0.12);
    scene.material = Material::new(0.5, 0.2, 0.5)?;
    let mut pour = Simulation::new(&scene, 1)?.with_settings(sweeps)?;
    let mut problems = Vec::new();
    for time in TIMES {
        pour.advance(time - pour.time());
        problems.push(pour.frozen_solve()?);
    }
    let counts: Vec<String> = problems.iter().map(|p| p.contact_count().to_string()).collect();
    println!("\ndt = 1/{:.0} s; {} contacts\n", 1.0 / dt, counts.join(" and "));
    println!("| method | residual at 0.3 s | ms | guarded | residual at 0.6 s | ms | guarded |");
    println!("|---|---|---|---|---|---|---|");
    for (name, settings) in methods(sweeps) {
        print!("| {name} |");
        for problem in &problems {
            let (solution, time) = solve(problem, &settings)?;
            let ms = 1e3 * time.as_secs_f64();
            let FrozenSolution { residual, guarded, unconverged, .. } = solution;
            let mark =
                if unconverged && settings.method == Method::Reference { " (!)" } else { "" };
            print!(" {residual:.1e}{mark} | {ms:.1} | {guarded} |");
        }
        println!();
    }
    Ok(())
}

/// The methods that are compared, by name.
fn methods(base: SolverSettings) -> Vec<(String, SolverSettings)> {
    let mut methods = Vec::new();
    for relaxation in [1.0, 1.4] {
        for count in [4, 20, 80, 400, 2000] {
            let settings = SolverSettings { relaxation, ..gauss_seidel(count, base) };
            methods.push((format!("nsgs, {relaxation}, {count} sweeps"), settings));
        }
    }
    let equations = [
        ("Fischer-Burmeister", Complementarity::FischerBurmeister),
        ("min-map", Complementarity::MinMap),
    ];
    for (name, complementarity) in equations {
        for (outer, inner, relaxation) in [
            (4, 20, 0.75),
            (4, 20, 1.0),
            (8, 10, 0.75),
            (16, 5, 0.75),
            (20, 20, 0.75),
            (20, 100, 0.75),
        ] {
            let newton = NewtonSettings { outer, inner, relaxation, complementarity };
            methods.push((
                format!("newton_pcr, {name}, {outer} x {inner}, {relaxation}"),
                SolverSettings { method: Method::NewtonPcr, newton, ..base },
            ));
        }
    }
    for residual in [1e-4, 1e-6, 1e-8] {
        let reference = ReferenceSettings { residual, ..ReferenceSettings::default() };
        methods.push((
            format!("reference, {residual:.0e}"),
            SolverSettings { method: Method::Reference, reference, ..base },
        ));
    }
    methods
}

/// Exactly `count` Gauss-Seidel sweeps.
fn gauss_seidel(count: usize, base: SolverSettings) -> SolverSettings {
    let (settled, closing) = (f64::MIN_POSITIVE, f64::MAX);
    let (sweeps, max_sweeps) = (count, count + 1);
    SolverSettings { method: Method::Nsgs, sweeps, settled, max_sweeps, closing, ..base }
}

/// A solution and the least CPU time that it took.
fn solve(
    problem: &FrozenSolve,
    settings: &SolverSettings,
) -> Result<(FrozenSolution, Duration), DemError> {
    let mut best = Duration::MAX;
    let mut solution = problem.solve(settings)?;
    for _ in 0..REPETITIONS {
        let start = ThreadTime::now();
        solution = problem.solve(settings)?;
        best = best.min(start.elapsed());
    }
    Ok((solution, best))
}
