//! Residual against cost of the three solver methods, on frozen substeps of the paper's funnel.
//!
//!     cargo run --release -p granulcal-dem --example solvers
//!
//! Prints the tables of docs/theory/solvers.md. A pour of 2000 grains is simulated with Gauss-Seidel sweeps to 0.3 s
//! (the funnel is full) and to 0.6 s (the pile grows); the contact problem of the next substep is then solved by each
//! method from the same warm impulses. Times are CPU times, the best of a few repetitions.

use std::time::Duration;

use cpu_time::ThreadTime;
use granulcal_dem::{
    Complementarity, DemError, FrozenSolution, FrozenSolve, Material, Method, NewtonSettings,
    Preset, ReferenceSettings, Scene, Simulation, SolverSettings,
};

/// Times at which a substep is frozen `[s]`.
const TIMES: [f64; 2] = [0.3, 0.6];
/// Solves of which the fastest counts.
const REPETITIONS: usize = 5;

fn main() -> Result<(), DemError> {
    for dt in [1.0 / 600.0, 1.0 / 2400.0] {
        table(dt)?;
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
        problems.push(pour.frozen_solve());
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
    for count in [5, 20, 80, 400, 2000] {
        methods.push((format!("nsgs, {count} sweeps"), gauss_seidel(count, base)));
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
