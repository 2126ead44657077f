//! `features`: a recording to its statistics.

mod args;

use anyhow::Context as _;
use granulcal_dataset::{Limits, Recording, npy, write_pictures};
use granulcal_features::{
    DIAGNOSTICS, DiagnosticSettings, Formation, PAPER16, Segmentation, Statistic, Threshold,
    diagnostics,
};
use granulcal_scene::{Prior, Scene};
use serde_json::{Map, Value, json};

use crate::context::{note, print_json, print_line};
use crate::edge::pixels_at_edge;
use crate::outcome::{BadArgument, Outcome};
use crate::run::{Run, Setting};
use crate::scene;
use crate::sides::SideFiles;
pub use args::FeaturesArgs;

impl Run for FeaturesArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(self)
    }
}

fn run(args: &FeaturesArgs) -> anyhow::Result<Outcome> {
    if args.list {
        return if args.diagnostics {
            list(&DIAGNOSTICS, args.json)
        } else {
            list(&PAPER16, args.json)
        };
    }
    let Some(path) = &args.recording else {
        return Err(BadArgument("a recording, or --list, must be given".to_owned()).into());
    };
    let recording = Recording::open(path, &args.read.options())?;
    for line in recording.damage.iter().chain(&recording.unlike) {
        note(&format!("warning: {line}"));
    }
    let scene = args.scene.as_ref().map(|name| scene::named(name)).transpose()?;
    let levelled =
        recording.level_with(&segmentation(args, scene.as_ref(), &recording.segmentation))?;
    let mut sides = SideFiles::default();
    if let Some(folder) = &args.debug_images {
        // Before the formation: where none is found, the pictures say why.
        let written = write_pictures(folder, &levelled).map(|pictures| {
            note(&format!(
                "pictures in {}: residual.png from -{residual:.2} mm (blue) to {residual:.2} mm (red), height.png from 0 (dark) to {:.2} mm (yellow), mask.png",
                folder.display(),
                1e3 * pictures.height,
                residual = 1e3 * pictures.residual,
            ));
        });
        sides.keep(written.context("writing --debug-images"));
    }
    let formation = recording.formation_of(levelled)?;
    if let (None, Some(edge)) = (args.border, pixels_at_edge(&formation)) {
        eprintln!("{edge}");
    }
    let doubts = scene.as_ref().map(|scene| doubts(scene, &recording, &formation)).transpose()?;
    for doubt in doubts.iter().flatten() {
        note(&format!("warning: {doubt}"));
    }
    let mut statistics = vec![named(&PAPER16, &recording.statistics_of(&formation)?)];
    if args.diagnostics {
        let values = diagnostics(&formation.points, &diagnostic_settings(args, &formation)?)
            .with_context(|| format!("describing {}", path.display()))?;
        statistics.push(named(&DIAGNOSTICS, &values));
    }
    if let Some(path) = &args.points {
        sides.keep(npy::write_points(path, &formation.points).context("writing --points"));
    }
    if args.json {
        print_json(&as_json(&recording, &formation, &statistics, doubts.as_deref()))?;
    } else {
        print(&recording, &formation, &statistics)?;
    }
    Ok(sides.finish(Outcome::whole_if(recording.lost.is_none())))
}

/// The recording's own segmentation with what the command line changes.
fn segmentation(args: &FeaturesArgs, scene: Option<&Scene>, own: &Segmentation) -> Segmentation {
    let mut changed = scene.map_or_else(|| own.clone(), |scene| own.as_seen_by(&scene.camera));
    if let Some(height) = args.threshold {
        changed.height_threshold = Threshold::Absolute(height);
    }
    changed.border_px = args.border.unwrap_or(changed.border_px);
    changed.region = args.region.or(changed.region);
    changed.downsample = args.downsample.or(changed.downsample);
    changed.max_height = args.max_height.or(changed.max_height);
    changed.min_component_px = args.min_component.unwrap_or(changed.min_component_px);
    changed
}

/// Why it cannot be a formation of the scene, of whatever material, or is doubtful as one.
fn doubts(
    scene: &Scene,
    recording: &Recording,
    formation: &Formation,
) -> anyhow::Result<Vec<String>> {
    let limits = Limits::of(scene, &Prior::default())?;
    let said = |limits: Limits| {
        [limits.violations(formation), limits.doubts_of(recording, formation)].concat()
    };
    Ok(limits.map(said).unwrap_or_default())
}

/// What the diagnostic statistics need besides the points.
fn diagnostic_settings(
    args: &FeaturesArgs,
    formation: &Formation,
) -> anyhow::Result<DiagnosticSettings> {
    let Some(grain_diameter) = args.grain_diameter else {
        return Err(BadArgument("--diagnostics needs --grain-diameter".to_owned()).into());
    };
    // The points are centred; the axis is given where the centroid is told.
    let pour_axis = args.pour_axis.as_ref().map(|axis| {
        let mut from_centroid = -formation.centroid;
        from_centroid.x += axis[0];
        from_centroid.y += axis[1];
        from_centroid
    });
    Ok(DiagnosticSettings { pour_axis, grain_diameter, spacing: formation.spacing() })
}

/// Name, unit and value of each statistic.
type Named = Vec<(&'static str, &'static str, f64)>;

fn named<P>(registry: &[Statistic<P>], values: &[f64]) -> Named {
    registry.iter().zip(values).map(|(s, &value)| (s.name, s.unit, value)).collect()
}

fn as_json(
    recording: &Recording,
    formation: &Formation,
    statistics: &[Named],
    doubts: Option<&[String]>,
) -> Value {
    let object = |family: &Named| -> Map<_, _> {
        family.iter().map(|(name, _, value)| ((*name).to_owned(), Value::from(*value))).collect()
    };
    let plane = &formation.plane;
    let mut report = json!({
        "recording": recording.path.display().to_string(),
        "topic": recording.topic,
        "statistics": statistics.first().map(object),
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
            "whole_frames": recording.whole_frames,
            "valid": formation.valid_count,
            "grains": formation.masked_count,
        },
        "lost": recording.lost.map(|lost| json!({
            "frames": lost.frames(),
            "how": lost.how(),
            "damage": recording.damage,
        })),
        // Null where a colour decides.
        "threshold_m": (!formation.is_by_colour).then_some(formation.threshold),
        "centroid_m": formation.centroid.as_slice(),
        // Null without a scene.
        "doubts": doubts,
    });
    if let Some(diagnostics) = statistics.get(1) {
        report["diagnostics"] = object(diagnostics).into();
    }
    report
}

fn print(recording: &Recording, formation: &Formation, statistics: &[Named]) -> anyhow::Result<()> {
    let plane = &formation.plane;
    print_line(&format!("recording          {}", recording.path.display()))?;
    if let Some(topic) = &recording.topic {
        print_line(&format!("topic              {topic}"))?;
    }
    print_line(&format!(
        "ground             tilt {:.2} deg, rms {:.2} mm, {} inliers, noise {:.2} mm",
        plane.tilt_rad.to_degrees(),
        plane.rms * 1e3,
        plane.inliers,
        // No sign of a zero.
        formation.ground_sd * 1e3 + 0.0
    ))?;
    print_line(&format!(
        "formation          {}, {:.1} cm3, half of it within {:.1} mm",
        formation.shape.kind.name(),
        formation.volume * 1e6,
        formation.shape.half_volume_radius * 1e3
    ))?;
    let rule = if formation.is_by_colour {
        "by their colour".to_owned()
    } else {
        format!("above {:.2} mm", formation.threshold * 1e3)
    };
    print_line(&format!(
        "pixels             {} of {} valid are grain ({rule})",
        formation.masked_count, formation.valid_count,
    ))?;
    print_line(&format!(
        "frames             {} of {} averaged{}",
        recording.frames,
        recording.whole_frames,
        recording.lost.map_or_else(String::new, |lost| format!(", {lost}"))
    ))?;
    for (name, unit, value) in statistics.iter().flatten() {
        print_line(&format!("{name:<18} {value:<12.6} {unit}"))?;
    }
    Ok(())
}

fn list<P>(registry: &[Statistic<P>], json: bool) -> anyhow::Result<Outcome> {
    if json {
        let entry = |s: &Statistic<P>| json!({ "name": s.name, "unit": s.unit, "doc": s.doc });
        print_json(&registry.iter().map(entry).collect::<Vec<_>>())?;
    } else {
        for statistic in registry {
            print_line(&format!(
                "{:<15} [{:^3}]  {}",
                statistic.name, statistic.unit, statistic.doc
            ))?;
        }
    }
    Ok(Outcome::Done)
}
