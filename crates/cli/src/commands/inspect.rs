//! `inspect`: what is in a file, or in one substep of a scene.

mod args;
mod contact_problem;
mod recording;

use std::fs;
use std::path::Path;

use anyhow::anyhow;
use granulcal_dataset::{
    CameraFile, Dataset, DatasetError, Folder, Npz, Prior, load_prior, load_scene, npy, png,
    read_checkpoint_header, read_text,
};
use granulcal_scene::Scene;
use serde_json::{Map, Value, json};

use crate::context::{print_json, print_line};
use crate::outcome::{BadArgument, Outcome};
use crate::rows::warn_of;
use crate::run::{Run, Setting};
pub use args::InspectArgs;

/// Letters within which small things stand on one line.
const ONE_LINE: usize = 110;
/// How many missing rows are named.
const NAMED_GAPS: usize = 5;

impl Run for InspectArgs {
    fn run(&self, _: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(self)
    }
}

fn run(args: &InspectArgs) -> anyhow::Result<Outcome> {
    let mut is_whole = true;
    let facts = if let Some(out) = &args.contact_problem {
        contact_problem::write(&args.path, out, &args.substep)?
    } else {
        args.substep.refuse_any()?;
        inspect(&args.path, &mut is_whole)?
    };
    if args.json {
        print_json(&facts)?;
    } else {
        for line in lines(&facts, "") {
            print_line(&line)?;
        }
    }
    Ok(Outcome::whole_if(is_whole))
}

fn inspect(path: &Path, is_whole: &mut bool) -> anyhow::Result<Value> {
    if path.is_dir() {
        return match Folder::open(path) {
            Ok(Folder::Frames(frames)) => Ok(recording::folder_facts(&frames, is_whole)),
            Ok(Folder::Messages(file)) => recording::facts(&file, is_whole),
            Err(_) => dataset_facts(path),
        };
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match ending.as_str() {
        "parquet" => dataset_facts(path),
        "toml" => toml_facts(path),
        "npy" => {
            let array = npy::read(path)?;
            let mut facts = json!({ "kind": "array", "shape": array.shape });
            add_range(&mut facts, &array.values);
            Ok(facts)
        }
        "npz" => npz_facts(path),
        "png" => png_facts(path),
        "ckpt" => checkpoint_facts(path),
        "bag" | "mcap" => recording::facts(path, is_whole),
        other => {
            // What is not there has no wrong ending.
            fs::metadata(path).map_err(|source| DatasetError::Io {
                action: "read",
                path: path.to_owned(),
                source,
            })?;
            let found = if other.is_empty() { "no ending" } else { other };
            let allowed = "a folder or .parquet, .toml, .npy, .npz, .png, .bag, .mcap, .ckpt";
            let path = path.display();
            Err(BadArgument(format!("{path}: must be {allowed}, found {found}")).into())
        }
    }
}

fn dataset_facts(path: &Path) -> anyhow::Result<Value> {
    let dataset = Dataset::open(path)?;
    warn_of(&dataset.header, &dataset.unverified);
    Ok(json!({
        "kind": "data set",
        "rows": dataset.rows.len(),
        "asked": dataset.asked,
        "rows missing": dataset.missing(),
        "missing": dataset.gaps(NAMED_GAPS),
        "status": dataset.status_counts(),
        "files without a hash": dataset.unverified.len(),
        "seed": dataset.header.seed,
        "version": dataset.header.version,
        "law": dataset.header.law,
        "arithmetic": dataset.header.arithmetic,
        "cpu_s": dataset.rows.iter().fold(0.0, |sum, row| sum + row.cpu_s),
        "scene": scene_facts(&dataset.header.scene),
        "prior": prior_facts(&dataset.header.prior),
    }))
}

fn scene_facts(scene: &Scene) -> Value {
    json!({
        "name": scene.name,
        "preset": scene.preset.name(),
        "grains": scene.grains.count,
        "diameter_m": scene.grains.diameter,
        "material": scene.material,
        "funnel": scene.funnel.is_some(),
        "walls": scene.walls.len(),
    })
}

fn prior_facts(prior: &Prior) -> Value {
    let describe = |p: &granulcal_dataset::Parameter| {
        (p.path.clone(), Value::from(p.distribution.to_string()))
    };
    prior.parameters().iter().map(describe).collect::<Map<_, _>>().into()
}

/// A .toml can be any of three things: the first that reads it wins, else all three say why not.
fn toml_facts(path: &Path) -> anyhow::Result<Value> {
    let with_kind = |kind: &str, mut facts: Value| {
        facts["kind"] = kind.into();
        facts
    };
    let scene = match load_scene(path) {
        Ok(scene) => return Ok(with_kind("scene", scene_facts(&scene))),
        Err(error @ DatasetError::Io { .. }) => return Err(error.into()),
        Err(error) => anyhow!(error),
    };
    let prior = match load_prior(path) {
        Ok(prior) => return Ok(with_kind("prior", prior_facts(&prior))),
        Err(error) => anyhow!(error),
    };
    let camera = match CameraFile::load(path) {
        Ok(camera) => return Ok(with_kind("camera", serde_json::to_value(camera)?)),
        Err(error) => anyhow!(error),
    };
    let is_task = read_text(path).is_ok_and(|text| text.contains("[[conditions]]"));
    let path = path.display();
    if is_task {
        let what = format!("{path} is the task of a loop: `granulcal close-loop {path} -o FOLDER");
        return Err(BadArgument(format!("{what} --dry-run` reads it")).into());
    }
    Err(BadArgument(format!(
        "{path} is no scene, prior or camera\nas a scene: {scene:#}\nas a prior: {prior:#}\nas a camera: {camera:#}"
    ))
    .into())
}

fn npz_facts(path: &Path) -> anyhow::Result<Value> {
    let mut archive = Npz::open(path)?;
    let mut facts = json!({ "kind": "arrays", "names": archive.names() });
    if archive.names().iter().any(|name| name == "depthmap") {
        let map = archive.height_map()?;
        facts["kind"] = "height map".into();
        facts["width"] = map.width.into();
        facts["height"] = map.height.into();
        facts["resolution_m"] = json!([map.resolution_x, map.resolution_y]);
        add_range(&mut facts, &map.z);
    }
    Ok(facts)
}

fn png_facts(path: &Path) -> anyhow::Result<Value> {
    match png::read_depth(path, 1.0) {
        Ok(image) => {
            let mut facts =
                json!({ "kind": "depth image", "width": image.width, "height": image.height });
            let valid: Vec<_> =
                image.depth.iter().filter(|d| **d > 0.0).map(|d| f64::from(*d)).collect();
            facts["pixels without data"] = (image.depth.len() - valid.len()).into();
            add_range(&mut facts, &valid);
            facts["unit"] = "counts; the camera's TOML says how many metres".into();
            Ok(facts)
        }
        Err(DatasetError::Content { .. }) => {
            let image = png::read_colour(path)?;
            Ok(json!({ "kind": "colour image", "width": image.width, "height": image.height }))
        }
        Err(other) => Err(other.into()),
    }
}

fn checkpoint_facts(path: &Path) -> anyhow::Result<Value> {
    let header = read_checkpoint_header(path)?;
    Ok(json!({
        "kind": "checkpoint",
        "version": header.version,
        "law": granulcal_dem::law_of(&header.scene),
        "arithmetic": granulcal_dem::arithmetic(&header.scene),
        "seed": header.seed,
        "substeps": header.substep,
        "simulated_s": header.time(),
        "scene": scene_facts(&header.scene),
    }))
}

/// Smallest and largest finite value, and how many are not finite.
fn add_range(facts: &mut Value, values: &[f64]) {
    let finite = || values.iter().copied().filter(|v| v.is_finite());
    facts["not finite"] = (values.len() - finite().count()).into();
    if finite().next().is_some() {
        let (low, high) =
            (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max));
        facts["range"] = json!([low, high]);
    }
}

/// A JSON object as indented lines.
fn lines(value: &Value, indent: &str) -> Vec<String> {
    let Value::Object(entries) = value else { return vec![format!("{indent}{value}")] };
    let mut lines = Vec::new();
    for (key, value) in entries {
        match value {
            Value::Object(inner) => {
                if let Some(text) = on_one_line(inner) {
                    lines.push(format!("{indent}{key}: {text}"));
                } else {
                    lines.push(format!("{indent}{key}:"));
                    lines.extend(self::lines(value, &format!("{indent}  ")));
                }
            }
            Value::String(text) => lines.push(format!("{indent}{key}: {text}")),
            Value::Array(entries)
                if entries.iter().all(Value::is_string) && !entries.is_empty() =>
            {
                lines.push(format!("{indent}{key}:"));
                let texts = entries.iter().filter_map(Value::as_str);
                lines.extend(texts.map(|text| format!("{indent}  {text}")));
            }
            other => lines.push(format!("{indent}{key}: {other}")),
        }
    }
    lines
}

/// Few plain values, `key value` each.
fn on_one_line(entries: &Map<String, Value>) -> Option<String> {
    let text = |(key, value): (&String, &Value)| match value {
        Value::Object(_) | Value::Array(_) => None,
        Value::String(text) => Some(format!("{key} {text}")),
        other => Some(format!("{key} {other}")),
    };
    let texts = entries.iter().map(text).collect::<Option<Vec<_>>>()?.join(", ");
    (texts.len() <= ONE_LINE && !texts.is_empty()).then_some(texts)
}
