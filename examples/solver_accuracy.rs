//! The 16 statistics of every scheme against `accurate` at points spread over the prior, with what they cost.
//!
//!     cargo run --release --example solver_accuracy -- out.csv            # pours what is missing, then the tables
//!     cargo run --release --example solver_accuracy -- out.csv paper      # of these schemes only
//!     cargo run --release --example solver_accuracy -- out.csv --only-tables
//!
//! Schemes are the presets and `reference`: the step of `default`, each substep solved to a residual of 1e-3, in 200
//! sweeps at most. One line of the file is one pour; a run that was stopped goes on where it was.

use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::OpenOptions;
use std::io::Write as _;

use cpu_time::ThreadTime;

use granulcal::dataset::observe;
use granulcal::dem::{
    Material, Method, Preset, ReferenceSettings, Scene, Simulation, SolverSettings,
};
use granulcal::features::PAPER16;

const SEEDS: u64 = 4;
/// Sliding friction, rolling friction and restitution: a Latin hypercube of 16 points and 6 on the rim.
const POINTS: [[f64; 3]; 22] = [
    [0.13, 0.022, 0.53],
    [0.19, 0.49, 0.08],
    [0.24, 0.0043, 0.31],
    [0.3, 0.16, 0.86],
    [0.36, 0.0016, 0.64],
    [0.41, 0.054, 0.2],
    [0.47, 0.75, 0.42],
    [0.52, 0.0105, 0.92],
    [0.58, 0.25, 0.03],
    [0.64, 0.0027, 0.14],
    [0.69, 0.105, 0.7],
    [0.75, 0.0066, 0.47],
    [0.81, 0.35, 0.58],
    [0.86, 0.034, 0.36],
    [0.92, 0.0012, 0.81],
    [0.97, 0.08, 0.25],
    [0.0, 0.1, 0.5],
    [1.0, 0.1, 0.5],
    [0.5, 0.001, 0.5],
    [0.5, 1.0, 0.5],
    [0.5, 0.1, 0.0],
    [0.5, 0.1, 0.95],
];

/// What the others are compared with.
const EXACT: &str = "accurate";

type Key = (usize, &'static str, u64);

/// Every scheme, from cheap to expensive.
fn schemes() -> Vec<(&'static str, SolverSettings)> {
    let reference = SolverSettings {
        method: Method::Reference,
        reference: ReferenceSettings { residual: 1e-3, max_sweeps: 200 },
        ..Preset::Default.settings()
    };
    let presets = [Preset::Fast, Preset::Default, Preset::Accurate, Preset::Paper];
    let mut schemes: Vec<_> =
        presets.into_iter().map(|preset| (preset.name(), preset.settings())).collect();
    schemes.push(("reference", reference));
    schemes
}

/// One pour: its statistics, if enough grains are in view, how it ended and what it took.
struct Row {
    status: String,
    cpu: f64,
    penetration: f64,
    statistics: Vec<f64>,
}

fn scene(point: usize) -> Scene {
    let [mu_s, mu_r, e] = POINTS[point];
    let material = Material::new(mu_s, mu_r, e).expect("a valid material");
    Scene { material, ..Scene::funnel(0.12) }
}

fn pour(point: usize, settings: SolverSettings, seed: u64) -> Row {
    let scene = scene(point);
    let begin = ThreadTime::now();
    let simulation = Simulation::new(&scene, seed).expect("a valid scene");
    let pour = simulation.with_settings(settings).expect("valid settings").run();
    let cpu = begin.elapsed().as_secs_f64();
    let seen = observe(&scene.camera, &pour, seed).expect("a camera");
    Row {
        status: pour.status.to_string(),
        cpu,
        penetration: pour.health.worst_penetration,
        statistics: seen.statistics.map_or(Vec::new(), |statistics| statistics.to_vec()),
    }
}

fn read(path: &str) -> HashMap<Key, Row> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let parse = |line: &str| {
        let fields: Vec<_> = line.split(',').collect();
        let statistics =
            fields.get(6..)?.iter().map(|field| field.parse().ok()).collect::<Option<_>>()?;
        let (scheme, _) = schemes().into_iter().find(|(name, _)| *name == fields[1])?;
        let key = (fields[0].parse().ok()?, scheme, fields[2].parse().ok()?);
        let (cpu, penetration) = (fields[4].parse().ok()?, fields[5].parse().ok()?);
        Some((key, Row { status: fields[3].to_owned(), cpu, penetration, statistics }))
    };
    text.lines().filter_map(parse).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn sd(values: &[f64]) -> f64 {
    let middle = mean(values);
    let squares: f64 = values.iter().map(|value| (value - middle).powi(2)).sum();
    (squares / (values.len() as f64 - 1.0)).sqrt()
}

/// Differences of the means over seeds from those of `accurate`, over its seed-to-seed standard deviation, pooled with
/// the scheme's own, over the first so many seeds; one number for each of the 16.
fn differences(
    rows: &HashMap<Key, Row>,
    point: usize,
    scheme: &'static str,
    seeds: usize,
) -> Option<Vec<f64>> {
    let values = |scheme, statistic: usize| -> Option<Vec<f64>> {
        (1..=seeds as u64)
            .map(|seed| rows.get(&(point, scheme, seed))?.statistics.get(statistic).copied())
            .collect()
    };
    (0..PAPER16.len())
        .map(|statistic| {
            let (ours, exact) = (values(scheme, statistic)?, values(EXACT, statistic)?);
            let pooled = (0.5 * (sd(&ours).powi(2) + sd(&exact).powi(2))).sqrt();
            let difference = mean(&ours) - mean(&exact);
            Some(if difference == 0.0 { 0.0 } else { difference / pooled })
        })
        .collect()
}

fn tables(rows: &HashMap<Key, Row>) -> String {
    let mut text = String::new();
    for (scheme, _) in schemes() {
        let _ = writeln!(
            text,
            "\n`{scheme}`\n\n| mu_s | mu_r | e | s a pour | penetration | ended | rms of 16 | worst | which | above 1 sd |\n|---|---|---|---|---|---|---|---|---|---|"
        );
        let (mut all, mut seconds, mut pours) = (Vec::new(), Vec::new(), 0);
        for (point, [mu_s, mu_r, e]) in POINTS.into_iter().enumerate() {
            let mine: Vec<_> =
                (1..=SEEDS).filter_map(|seed| rows.get(&(point, scheme, seed))).collect();
            // A spread takes two.
            if mine.len() < 2 {
                continue;
            }
            pours += mine.len();
            let cpu = mean(&mine.iter().map(|row| row.cpu).collect::<Vec<_>>());
            let deepest = mine.iter().map(|row| row.penetration).fold(0.0, f64::max);
            let mut ended: Vec<_> = mine.iter().map(|row| row.status.as_str()).collect();
            ended.sort_unstable();
            ended.dedup();
            seconds.push(cpu);
            let _ = write!(
                text,
                "| {mu_s} | {mu_r} | {e} | {cpu:.2} | {deepest:.3} | {} ",
                ended.join(", ")
            );
            match differences(rows, point, scheme, mine.len()) {
                Some(found) => {
                    let rms = (found.iter().map(|d| d * d).sum::<f64>() / 16.0).sqrt();
                    let worst = (0..16).max_by(|&a, &b| found[a].abs().total_cmp(&found[b].abs()));
                    let worst = worst.expect("16 of them");
                    let above = found.iter().filter(|d| d.abs() > 1.0).count();
                    let name = PAPER16[worst].name;
                    let _ =
                        writeln!(text, "| {rms:.2} | {:+.2} | {name} | {above} |", found[worst]);
                    all.extend(found);
                }
                None => text.push_str("| - | - | - | - |\n"),
            }
        }
        if !all.is_empty() {
            let rms = (all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64).sqrt();
            let above = all.iter().filter(|d| d.abs() > 1.0).count();
            let _ = writeln!(
                text,
                "\n{pours} pours, mean {:.2} s; rms {rms:.2} sd; {above} of {} differences above 1 sd",
                mean(&seconds),
                all.len()
            );
        }
    }
    text
}

fn main() {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let path = arguments.first().expect("the CSV file to go on with");
    let chosen: Vec<_> = arguments[1..].iter().filter(|word| !word.starts_with("--")).collect();
    let mut rows = read(path);
    if !arguments.iter().any(|argument| argument == "--only-tables") {
        let mut file = OpenOptions::new().create(true).append(true).open(path).expect("the file");
        for (scheme, settings) in schemes() {
            if !chosen.is_empty() && !chosen.iter().any(|word| *word == scheme) {
                continue;
            }
            // Seeds outside, so that a run cut off has every point.
            for seed in 1..=SEEDS {
                for point in 0..POINTS.len() {
                    let key = (point, scheme, seed);
                    if rows.contains_key(&key) {
                        continue;
                    }
                    let row = pour(point, settings, seed);
                    let mut line = format!(
                        "{point},{scheme},{seed},{},{:.3},{:.4}",
                        row.status, row.cpu, row.penetration
                    );
                    row.statistics.iter().for_each(|value| {
                        let _ = write!(line, ",{value}");
                    });
                    writeln!(file, "{line}").expect("written");
                    eprintln!(
                        "{scheme} point {} of {} seed {seed}: {} in {:.1} s",
                        point + 1,
                        POINTS.len(),
                        row.status,
                        row.cpu
                    );
                    rows.insert(key, row);
                }
            }
        }
    }
    println!("{}", tables(&rows));
}
