//! `fit-sensor`: frames of a flat surface to a sensor.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use granulcal_dataset::{CameraFile, DatasetError, Recording, Source, save_sensor, write_file};
use granulcal_features::sensor::fit::{
    Comparison, FitSettings, FlatFrames, SensorFit, compare, fit,
};
use granulcal_features::{Camera, DepthImage, DepthSensor, HeightMap, NoiseField};
use serde_json::{Value, json};

use crate::args::FitSensorArgs;
use crate::context::{note, print_json, print_line};
use crate::outcome::{BadArgument, Outcome};

/// Endings of the files of a folder that are frames.
const ENDINGS: [&str; 2] = ["png", "npz"];

pub fn run(args: &FitSensorArgs) -> anyhow::Result<Outcome> {
    let frames = frames(&args.frames, args)?;
    let mut settings = FitSettings {
        regions: args.regions.clone(),
        trend_degree: args.trend,
        max_lag: args.max_lag,
        max_shift: args.max_shift,
        sessions: args.sessions,
        seed: args.seed,
    };
    let found = fit(&frames, &settings).context("fitting the sensor")?;
    let checked = if args.check.is_empty() && args.check_regions.is_empty() {
        None
    } else {
        if !args.check_regions.is_empty() {
            settings.regions.clone_from(&args.check_regions);
        }
        let others = if args.check.is_empty() { frames } else { self::frames(&args.check, args)? };
        Some(compare(&found.sensor, &others, &settings).context("comparing the sensor")?)
    };
    if let Some(path) = &args.out {
        save_sensor(path, &found.sensor)?;
    }
    let report = as_json(&found, checked.as_ref());
    if let Some(path) = &args.report {
        write_file(path, serde_json::to_string_pretty(&report)?.as_bytes())?;
    }
    if args.json {
        print_json(&report)?;
    } else {
        print(&found, checked.as_ref())?;
    }
    if found.comparison.frames == 1 {
        note("note: one frame does not tell fixed pattern from noise; all is counted as noise");
    }
    Ok(Outcome::Done)
}

/// All frames of files and folders: depth images of one camera, or height maps of one rig.
fn frames(paths: &[PathBuf], args: &FitSensorArgs) -> anyhow::Result<FlatFrames> {
    let camera_file = args.camera.as_deref().map(CameraFile::load).transpose()?;
    let mut images: Vec<DepthImage> = Vec::new();
    let mut maps: Vec<HeightMap> = Vec::new();
    let mut lens: Option<Camera> = None;
    for path in expanded(paths)? {
        match Recording::open(&path, args.camera.as_deref())?.source {
            Source::Heights(map) => maps.push(map),
            Source::Depth { camera, image, .. } => {
                lens = Some(camera);
                images.push(image);
            }
        }
    }
    let flat = match (lens, camera_file, maps.is_empty()) {
        (Some(camera), Some(file), true) => match args.baseline {
            Some(baseline) => FlatFrames::from_stereo(&images, &camera, baseline, file.depth_unit),
            None => FlatFrames::from_time_of_flight(&images, &camera, file.depth_unit),
        },
        (None, _, false) => FlatFrames::from_height_maps(&maps),
        _ => {
            let refusal = "frames must be all depth images or all height maps".to_owned();
            return Err(BadArgument(refusal).into());
        }
    };
    Ok(flat?)
}

/// The files, and the frames of the folders in the order of their names.
fn expanded(paths: &[PathBuf]) -> Result<Vec<PathBuf>, DatasetError> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let failed = |source| DatasetError::Io { action: "list", path: path.clone(), source };
        let entries = std::fs::read_dir(path).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let is_frame = |path: &Path| {
            let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
            ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
        };
        let mut inside: Vec<_> =
            entries.map_err(failed)?.iter().map(std::fs::DirEntry::path).collect();
        inside.retain(|path| is_frame(path));
        inside.sort();
        files.append(&mut inside);
    }
    Ok(files)
}

fn as_json(found: &SensorFit, checked: Option<&Comparison>) -> Value {
    json!({
        "sensor": found.sensor,
        "edge_holes": found.edge_holes,
        "fit": comparison_json(&found.comparison),
        "check": checked.map(comparison_json),
    })
}

fn comparison_json(comparison: &Comparison) -> Value {
    let (measured, model) = comparison.sd();
    json!({
        "sd_measured": measured,
        "sd_model": model,
        "worst_correlation": comparison.worst_correlation(usize::MAX - 1),
        "covariances": comparison,
    })
}

fn print(found: &SensorFit, checked: Option<&Comparison>) -> anyhow::Result<()> {
    let unit = found.comparison.unit;
    match &found.sensor {
        DepthSensor::Stereo(sensor) => {
            print_line(&format!(
                "sensor         stereo, focal length {:.1} px, baseline {:.2} mm",
                sensor.focal_length,
                1e3 * sensor.baseline
            ))?;
            print_line(&format!(
                "rounding       disparity {}, depth {:.2} mm",
                match sensor.quantisation {
                    0.0 => "continuous".to_owned(),
                    step => format!("1/{:.0} px", 1.0 / step),
                },
                1e3 * sensor.depth_unit
            ))?;
            print_line(&format!(
                "holes          at edges the jump + {:.1} px ({} holes), left band the disparity + {:.1} px, drop-out {:.2} %",
                sensor.edge_margin,
                found.edge_holes,
                sensor.left_margin,
                100.0 * sensor.dropout
            ))?;
        }
        DepthSensor::TimeOfFlight(sensor) => {
            print_line(&format!(
                "sensor         time of flight, {:.3} mm of ground per px, drop-out {:.2} %",
                1e3 * sensor.resolution,
                100.0 * sensor.dropout
            ))?;
        }
    }
    print_field("noise", found.sensor.noise(), unit)?;
    print_field("fixed pattern", found.sensor.fixed_pattern(), unit)?;
    print_comparison("fitted to", &found.comparison)?;
    if let Some(checked) = checked {
        print_comparison("checked on", checked)?;
    }
    Ok(())
}

fn print_field(name: &str, field: &NoiseField, unit: &str) -> anyhow::Result<()> {
    let (scale, unit) = if unit == "m" { (1e3, "mm") } else { (1.0, unit) };
    let mut parts = Vec::new();
    let mut part = |sd: f64, text: String| {
        if sd > 0.0 {
            parts.push(format!("{:.4} {text}", scale * sd));
        }
    };
    part(field.white, "white".to_owned());
    let size = |x: f64, y: f64| format!("{x:.1} x {y:.1} px");
    part(field.correlated, format!("over {}", size(field.correlation_x, field.correlation_y)));
    part(field.broad, format!("over {}", size(field.broad_x, field.broad_y)));
    part(field.columns, format!("in columns, over {:.1} px", field.column_correlation));
    part(field.rows, format!("in rows, over {:.1} px", field.row_correlation));
    part(field.row_alternation, "in alternating rows".to_owned());
    let detail = if parts.is_empty() { "none".to_owned() } else { parts.join(", ") };
    print_line(&format!("{name:<14} sd {:.4} {unit}: {detail}", scale * field.sd()))
}

fn print_comparison(name: &str, comparison: &Comparison) -> anyhow::Result<()> {
    let (measured, model) = comparison.sd();
    let (scale, unit) = if comparison.unit == "m" { (1e3, "mm") } else { (1.0, comparison.unit) };
    print_line("")?;
    print_line(&format!(
        "{name} {} frame(s) of {} px: sd measured {:.4} {unit}, model {:.4} {unit} ({:+.1} %)",
        comparison.frames,
        comparison.pixels,
        scale * measured,
        scale * model,
        100.0 * (model / measured - 1.0)
    ))?;
    print_line("correlation at px   measured x   model x   measured y   model y")?;
    let (seen, simulated) = (comparison.measured.total(), comparison.model.total());
    let (a, b) = (seen.variance(), simulated.variance());
    for lag in [1, 2, 3, 5, 8, 12, 16, 20, 24].into_iter().filter(|&lag| lag < seen.x.len()) {
        print_line(&format!(
            "{lag:>17}   {:>10.3}   {:>7.3}   {:>10.3}   {:>7.3}",
            seen.x[lag] / a,
            simulated.x[lag] / b,
            seen.y[lag] / a,
            simulated.y[lag] / b
        ))?;
    }
    let longest = seen.x.len() - 1;
    print_line(&format!(
        "largest difference of the correlations up to {longest} px: {:.3}",
        comparison.worst_correlation(longest)
    ))
}
