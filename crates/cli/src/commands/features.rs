//! `features`: a recording to its statistics.

use granulcal_dataset::{Recording, npy, write_pictures};
use granulcal_features::{Formation, PAPER16, Segmentation, Threshold};
use serde_json::{Map, Value, json};

use crate::args::FeaturesArgs;
use crate::context::{note, print_json, print_line};
use crate::outcome::{BadArgument, Outcome};
use crate::scene;

pub fn run(args: &FeaturesArgs) -> anyhow::Result<Outcome> {
    if args.list {
        return list(args.json);
    }
    let Some(path) = &args.recording else {
        return Err(BadArgument("a recording, or --list, must be given".to_owned()).into());
    };
    let recording = Recording::open(path, args.camera.as_deref())?;
    let levelled = recording.level_with(&segmentation(args, &recording.segmentation)?)?;
    if let Some(folder) = &args.debug_images {
        // Before the formation: where none is found, the pictures say why.
        let pictures = write_pictures(folder, &levelled)?;
        note(&format!(
            "pictures in {}: residual.png from -{residual:.2} mm (blue) to {residual:.2} mm (red), height.png from 0 (dark) to {:.2} mm (yellow), mask.png",
            folder.display(),
            1e3 * pictures.height,
            residual = 1e3 * pictures.residual,
        ));
    }
    let formation = recording.formation_of(levelled)?;
    let statistics = recording.statistics_of(&formation)?;
    if let Some(path) = &args.points {
        npy::write_points(path, &formation.points)?;
    }
    if args.json {
        print_json(&as_json(&recording, &formation, &statistics))?;
    } else {
        print(&recording, &formation, &statistics)?;
    }
    Ok(Outcome::Done)
}

/// The recording's own segmentation with what the command line changes.
fn segmentation(args: &FeaturesArgs, own: &Segmentation) -> anyhow::Result<Segmentation> {
    let mut changed = own.clone();
    if let Some(name) = &args.scene {
        changed.downsample = None;
        changed.ground_resolution = Some(scene::named(name)?.camera.ground_resolution());
    }
    if let Some(height) = args.threshold {
        changed.height_threshold = Threshold::Absolute(height);
    }
    changed.border_px = args.border.unwrap_or(changed.border_px);
    changed.downsample = args.downsample.or(changed.downsample);
    changed.max_height = args.max_height.or(changed.max_height);
    changed.min_component_px = args.min_component.unwrap_or(changed.min_component_px);
    Ok(changed)
}

fn as_json(recording: &Recording, formation: &Formation, statistics: &[f64; 16]) -> Value {
    let named = PAPER16.iter().zip(statistics);
    let statistics: Map<_, _> =
        named.map(|(s, value)| (s.name.to_owned(), Value::from(*value))).collect();
    let plane = &formation.plane;
    json!({
        "recording": recording.path.display().to_string(),
        "statistics": statistics,
        "plane": {
            "normal": plane.plane.normal.as_slice(),
            "offset_m": plane.plane.offset,
            "tilt_deg": plane.tilt_rad.to_degrees(),
            "rms_m": plane.rms,
            "inliers": plane.inliers,
            "noise_m": formation.ground_sd,
        },
        "formation": {
            "kind": formation.shape.kind.name(),
            "volume_m3": formation.volume,
            "half_volume_radius_m": formation.shape.half_volume_radius,
        },
        "pixel": {
            "downsample": formation.downsample,
            "width_m": [formation.resolution.0, formation.resolution.1],
        },
        "counts": {
            "frames": recording.frames,
            "valid": formation.valid_count,
            "grains": formation.masked_count,
        },
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
    print_line(&format!(
        "ground             tilt {:.2} deg, rms {:.2} mm, {} inliers, noise {:.2} mm",
        plane.tilt_rad.to_degrees(),
        plane.rms * 1e3,
        plane.inliers,
        formation.ground_sd * 1e3
    ))?;
    print_line(&format!(
        "formation          {}, {:.1} cm3, half of it within {:.1} mm",
        formation.shape.kind.name(),
        formation.volume * 1e6,
        formation.shape.half_volume_radius * 1e3
    ))?;
    print_line(&format!(
        "pixels             {} of {} valid are grain (above {:.2} mm), {} frames",
        formation.masked_count,
        formation.valid_count,
        formation.threshold * 1e3,
        recording.frames
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
