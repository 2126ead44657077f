//! `fit-sensor`: frames of a flat surface to a sensor.

mod args;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use granulcal_dataset::{DatasetError, Form, Recording, Source, save_sensor, write_file};
use granulcal_features::sensor::fit::{
    Comparison, FitSettings, FlatFrames, SensorFit, compare, fit,
};
use granulcal_features::{Camera, DepthImage, DepthSensor, HeightMap, Moments, NoiseField};
use serde_json::{Value, json};

use crate::args::paths::Reads;
use crate::context::{note, print_json, print_line};
use crate::outcome::{BadArgument, Outcome};
use crate::run::{Run, Setting};
use crate::sides::SideFiles;
pub use args::FitSensorArgs;

impl Run for FitSensorArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(self)
    }
}

fn run(args: &FitSensorArgs) -> anyhow::Result<Outcome> {
    let (frames, mut is_whole) = frames(&args.recordings, args)?;
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
        let others = if args.check.is_empty() {
            frames
        } else {
            let (others, whole) = self::frames(&args.check, args)?;
            is_whole &= whole;
            others
        };
        Some(compare(&found.sensor, &others, &settings).context("comparing the sensor")?)
    };
    let mut sides = SideFiles::default();
    if let Some(path) = &args.out {
        sides.keep(save_sensor(path, &found.sensor).context("writing --out"));
    }
    let report = as_json(&found, checked.as_ref());
    if let Some(path) = &args.report {
        let text = serde_json::to_string_pretty(&report)?;
        sides.keep(write_file(path, Form::Json, text.as_bytes()).context("writing --report"));
    }
    if args.json {
        print_json(&report)?;
    } else {
        print(&found, checked.as_ref())?;
    }
    if found.comparison.frames == 1 {
        note("note: one frame does not tell fixed pattern from noise; all is counted as noise");
    }
    Ok(sides.finish(Outcome::whole_if(is_whole)))
}

/// All frames of the recordings: depth images of one camera, or height maps of one rig; and whether
/// none is lost.
fn frames(paths: &[Reads], args: &FitSensorArgs) -> anyhow::Result<(FlatFrames, bool)> {
    let mut is_whole = true;
    let (mut images, mut maps) = (Vec::<DepthImage>::new(), Vec::<HeightMap>::new());
    let mut taken: Option<(Camera, f64)> = None;
    for path in expanded(paths)? {
        for recording in Recording::open_each(&path, &args.read.options())? {
            is_whole &= recording.lost.is_none();
            for line in &recording.damage {
                note(&format!("warning: {line}"));
            }
            match (recording.source, recording.depth_unit) {
                (Source::Heights(map), _) => maps.push(map),
                (Source::Depth { camera, image, .. }, unit) => {
                    let unit = unit.ok_or_else(|| {
                        BadArgument(format!(
                            "{}: the camera must have a depth_unit: depths in metres are rounded to it, too",
                            recording.path.display()
                        ))
                    })?;
                    let (first, first_unit) = *taken.get_or_insert((camera, unit));
                    if (first.intrinsics, first_unit) != (camera.intrinsics, unit) {
                        let other = format!("{} was taken by another camera", path.display());
                        return Err(BadArgument(other).into());
                    }
                    images.push(image);
                }
            }
        }
    }
    let flat = match (taken, maps.is_empty(), args.baseline) {
        (Some((camera, unit)), true, Some(baseline)) => {
            FlatFrames::from_stereo(&images, &camera, baseline, unit)
        }
        (Some((camera, unit)), true, None) => {
            FlatFrames::from_time_of_flight(&images, &camera, unit)
        }
        (None, false, None) => FlatFrames::from_height_maps(&maps),
        (None, _, Some(_)) => {
            let refusal = "--baseline is of depth images; height maps have none".to_owned();
            return Err(BadArgument(refusal).into());
        }
        _ => {
            let refusal = "recordings must be all depth images or all height maps".to_owned();
            return Err(BadArgument(refusal).into());
        }
    };
    Ok((flat?, is_whole))
}

/// The recordings: of a folder of height maps each by itself, in the order of their names.
fn expanded(paths: &[Reads]) -> Result<Vec<PathBuf>, DatasetError> {
    let mut recordings = Vec::new();
    for path in paths {
        let maps = if path.is_dir() { height_maps(path)? } else { Vec::new() };
        if maps.is_empty() {
            recordings.push(path.to_path_buf());
        } else {
            recordings.extend(maps);
        }
    }
    Ok(recordings)
}

/// The height maps of a folder.
fn height_maps(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let failed = |source| DatasetError::Io { action: "list", path: folder.to_owned(), source };
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let mut maps: Vec<_> = entries.map_err(failed)?.iter().map(std::fs::DirEntry::path).collect();
    maps.retain(|path| path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("npz")));
    maps.sort();
    Ok(maps)
}

fn as_json(found: &SensorFit, checked: Option<&Comparison>) -> Value {
    json!({
        "sensor": found.sensor,
        "edge_holes": found.edge_holes,
        "flatness": found.flatness,
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
    print_line(&format!(
        "flatness       {:.1} % of the pixels on one surface (at least {:.0}), {:.2} % off it (at most 5)",
        100.0 * found.flatness.on_surface,
        100.0 * found.flatness.least_on_surface(),
        100.0 * found.flatness.deviation
    ))?;
    print_line(&match found.flatness.bump {
        Some(ratio) => format!(
            "largest bump   {ratio:.2} of what chance brings a part of a frame off the rest (at most 1)"
        ),
        None => {
            "largest bump   not known: too few parts of the frames are independent of each other"
                .to_owned()
        }
    })?;
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
