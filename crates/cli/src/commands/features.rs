//! `features`: a recording to its statistics.

use granulcal_dataset::{Recording, npy};
use granulcal_features::{Formation, PAPER16, Segmentation, Threshold};
use serde_json::{Map, Value, json};

use crate::args::FeaturesArgs;
use crate::context::{note, print_json, print_line};
use crate::outcome::{BadArgument, Outcome};

pub fn run(args: &FeaturesArgs) -> anyhow::Result<Outcome> {
    if args.list {
        return list(args.json);
    }
    let Some(path) = &args.recording else {
        return Err(BadArgument("a recording, or --list, must be given".to_owned()).into());
    };
    let recording = Recording::open(path, &args.read.options())?;
    for line in &recording.damage {
        note(&format!("warning: {line}"));
    }
    let formation = recording.formation_with(&segmentation(args, &recording.segmentation))?;
    let statistics = recording.statistics_of(&formation)?;
    if let Some(path) = &args.points {
        npy::write_points(path, &formation.points)?;
    }
    if args.json {
        print_json(&as_json(&recording, &formation, &statistics))?;
    } else {
        print(&recording, &formation, &statistics)?;
    }
    Ok(Outcome::whole_if(recording.lost.is_none()))
}

/// The recording's own segmentation with what the command line changes.
fn segmentation(args: &FeaturesArgs, own: &Segmentation) -> Segmentation {
    let mut changed = own.clone();
    if let Some(height) = args.threshold {
        changed.height_threshold = Threshold::Absolute(height);
    }
    changed.border_px = args.border.unwrap_or(changed.border_px);
    changed.downsample = args.downsample.unwrap_or(changed.downsample);
    changed.max_height = args.max_height.or(changed.max_height);
    changed.min_component_px = args.min_component.unwrap_or(changed.min_component_px);
    changed
}

fn as_json(recording: &Recording, formation: &Formation, statistics: &[f64; 16]) -> Value {
    let named = PAPER16.iter().zip(statistics);
    let statistics: Map<_, _> =
        named.map(|(s, value)| (s.name.to_owned(), Value::from(*value))).collect();
    let plane = &formation.plane;
    json!({
        "recording": recording.path.display().to_string(),
        "topic": recording.topic,
        "statistics": statistics,
        "plane": {
            "normal": plane.plane.normal.as_slice(),
            "offset_m": plane.plane.offset,
            "tilt_deg": plane.tilt_rad.to_degrees(),
            "rms_m": plane.rms,
            "inliers": plane.inliers,
        },
        "counts": {
            "frames": recording.frames,
            "whole_frames": recording.whole_frames,
            "valid": formation.valid_count,
            "grains": formation.masked_count,
        },
        "lost": recording.lost.map(|lost| json!({
            "frames": lost.frames(),
            "how": lost.how(),
            "damage": recording.damage,
        })),
        "threshold_m": formation.threshold,
        "centroid_m": formation.centroid.as_slice(),
    })
}

fn print(
    recording: &Recording,
    formation: &Formation,
    statistics: &[f64; 16],
) -> anyhow::Result<()> {
    let plane = &formation.plane;
    print_line(&format!("recording          {}", recording.path.display()))?;
    if let Some(topic) = &recording.topic {
        print_line(&format!("topic              {topic}"))?;
    }
    print_line(&format!(
        "ground             tilt {:.2} deg, rms {:.2} mm, {} inliers",
        plane.tilt_rad.to_degrees(),
        plane.rms * 1e3,
        plane.inliers
    ))?;
    print_line(&format!(
        "pixels             {} of {} valid are grain (above {:.2} mm)",
        formation.masked_count,
        formation.valid_count,
        formation.threshold * 1e3,
    ))?;
    print_line(&format!(
        "frames             {} of {} averaged{}",
        recording.frames,
        recording.whole_frames,
        recording.lost.map_or_else(String::new, |lost| format!(", {lost}"))
    ))?;
    for (statistic, value) in PAPER16.iter().zip(statistics) {
        print_line(&format!("{:<18} {value:<12.6} {}", statistic.name, statistic.unit))?;
    }
    Ok(())
}

fn list(json: bool) -> anyhow::Result<Outcome> {
    if json {
        let entry = |s: &granulcal_features::Statistic| json!({ "name": s.name, "unit": s.unit, "doc": s.doc });
        print_json(&PAPER16.iter().map(entry).collect::<Vec<_>>())?;
    } else {
        for statistic in &PAPER16 {
            print_line(&format!(
                "{:<12} [{:^3}]  {}",
                statistic.name, statistic.unit, statistic.doc
            ))?;
        }
    }
    Ok(Outcome::Done)
}
