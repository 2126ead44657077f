//! `infer`: recordings to the posterior of a trained model.

use std::path::Path;
use std::time::Instant;

use anyhow::Context as _;
use granulcal_bayessim::{Marginal, Model, Posterior};
use granulcal_dataset::{Recording, scene_from_text};
use granulcal_features::PAPER16;
use serde_json::{Map, Value, json};

use crate::args::InferArgs;
use crate::context::{note, print_json, print_line};
use crate::outcome::{BadArgument, Outcome};

/// Draws behind means and intervals.
const SUMMARY_DRAWS: usize = 10_000;

pub fn run(args: &InferArgs) -> anyhow::Result<Outcome> {
    let model = Model::load(&args.model)?;
    if !model.x_names.iter().map(String::as_str).eq(PAPER16.iter().map(|s| s.name)) {
        let found = model.x_names.join(", ");
        return Err(BadArgument(format!("the model has other statistics: {found}")).into());
    }
    let ground_resolution = match &model.scene_toml {
        // The scene may name meshes that are not here; the camera does not need them.
        Some(text) => {
            scene_from_text(text, Path::new("")).ok().map(|scene| scene.camera.ground_resolution())
        }
        None => None,
    };
    let mut is_whole = true;
    let mut observed = Vec::with_capacity(args.recordings.len());
    for path in &args.recordings {
        let recording = Recording::open(path, &args.read.options())?;
        for line in &recording.damage {
            note(&format!("warning: {line}"));
        }
        is_whole &= recording.lost.is_none();
        let mut segmentation = recording.segmentation.clone();
        segmentation.ground_resolution = ground_resolution.or(segmentation.ground_resolution);
        let formation = recording.formation_with(&segmentation)?;
        let statistics = recording
            .statistics_of(&formation)
            .with_context(|| format!("describing {}", path.display()))?;
        observed.push(statistics.to_vec());
    }
    let started = Instant::now();
    let posterior = model.posterior(&observed)?;
    let marginals = posterior.marginals(SUMMARY_DRAWS, args.seed);
    let seconds = started.elapsed().as_secs_f64();
    if args.json {
        print_json(&as_json(args, &model, &posterior, &marginals, &observed, seconds))?;
    } else {
        print(&marginals)?;
        for warning in &posterior.warnings {
            note(&format!("note: {warning}"));
        }
    }
    if model.is_calibrated != Some(true) {
        note("note: the model has not passed a check of its own: see `granulcal check`");
    }
    Ok(Outcome::whole_if(is_whole))
}

fn as_json(
    args: &InferArgs,
    model: &Model,
    posterior: &Posterior,
    marginals: &[Marginal],
    observed: &[Vec<f64>],
    seconds: f64,
) -> Value {
    let parameters: Map<_, _> = marginals
        .iter()
        .map(|m| {
            let interval = [m.interval90.0, m.interval90.1];
            let value = json!({ "mean": m.mean, "median": m.median, "interval90": interval });
            (m.name.clone(), value)
        })
        .collect();
    let statistics = |row: &Vec<f64>| -> Map<String, Value> {
        model.x_names.iter().cloned().zip(row.iter().map(|&v| Value::from(v))).collect()
    };
    let paths: Vec<_> = args.recordings.iter().map(|path| path.display().to_string()).collect();
    let warnings: Vec<_> = posterior.warnings.iter().map(ToString::to_string).collect();
    let mut report = json!({
        "recordings": paths,
        "parameters": parameters,
        "calibrated": model.is_calibrated,
        "warnings": warnings,
        "statistics": observed.iter().map(statistics).collect::<Vec<_>>(),
        "posterior_s": seconds,
    });
    if args.samples > 0 {
        report["samples"] = json!(posterior.sample(args.samples, args.seed));
    }
    report
}

fn print(marginals: &[Marginal]) -> anyhow::Result<()> {
    print_line(&format!("{:<30}{:>10}{:>10}   90 % interval", "parameter", "median", "mean"))?;
    for m in marginals {
        let (low, high) = m.interval90;
        print_line(&format!(
            "{:<30}{:>10.4}{:>10.4}   {low:.4} to {high:.4}",
            m.name, m.median, m.mean
        ))?;
    }
    Ok(())
}
