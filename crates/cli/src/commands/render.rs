//! `render`: the image that the scene's camera delivers.

use std::path::Path;

use clap::Args;
use granulcal_dataset::{
    CameraFile, Drawn, Observer, Product, Room, View, capture, capture_from, npy, png,
    write_height_map,
};
use granulcal_dem::{Simulation, Status};
use granulcal_scene::{CameraSpec, Projection, Scene, ViewSpec};
use serde_json::{Value, json};

use crate::args::SceneArgs;
use crate::args::numbers::{positive, seed};
use crate::args::paths::{Reads, Writes, writes};
use crate::context::{Context, note, print_json, print_line};
use crate::outcome::{BadArgument, Outcome};
use crate::run::{Run, Setting};
use crate::scene::{self, Keep};
use crate::sides::SideFiles;

/// Simulate or take grains and write the depth image that the scene's camera sees
#[derive(Debug, Args)]
#[command(long_about = "\
Writes the image that the scene's camera delivers, down-sampled and with the
scene's noise: a 16-bit PNG of depth with the camera's TOML beside it, or an
.npz height map for an orthographic camera. Both can be read back by
`features`.

Example:
  granulcal-cli render funnel --seed 1 -o pile.png
  granulcal-cli features pile.png --camera pile.toml
  granulcal-cli render funnel --positions grains.npy -o pile.png")]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Image to write: .png for a pinhole camera, .npz for an orthographic one
    #[arg(long = "out", short = 'o', value_parser = writes(Product::View))]
    pub out: Writes,
    /// What this one of the scene's views sees, a depth image without noise, instead of the scene's camera
    #[arg(long, value_name = "NAME")]
    pub view: Option<String>,
    /// Render these centres [m], an array (n, 3), with the radii of the scene's grains at --seed, instead of a pour
    #[arg(long, value_name = "IN.npy")]
    pub positions: Option<Reads>,
    /// Seed of the pour, of the radii of --positions and of the camera's noise
    #[arg(long, default_value_t = 0, value_parser = seed, allow_negative_numbers = true)]
    pub seed: u64,
    /// Metres per count of the PNG
    #[arg(long, default_value_t = granulcal_dataset::png::DEPTH_UNIT, value_name = "METRES",
        value_parser = positive)]
    pub depth_unit: f64,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

impl Run for RenderArgs {
    fn run(&self, setting: &Setting<'_>) -> anyhow::Result<Outcome> {
        run(setting.context, self)
    }
}

fn run(context: &Context, args: &RenderArgs) -> anyhow::Result<Outcome> {
    let scene = scene::load(&args.scene)?;
    let further = args.view.as_deref().map(|name| find_view(&scene, name)).transpose()?;
    match further {
        Some(_) => check_ending(&args.out, "a view", "png")?,
        None => check_name(&args.out, &scene)?,
    }
    let (positions, radii, convex) = if let Some(path) = &args.positions {
        if scene.grains.shape.is_some() {
            let problem =
                "--positions has no orientations, so it cannot draw grains of a grains.shape";
            return Err(BadArgument(problem.to_owned()).into());
        }
        let positions = npy::read_points(path)?;
        let radii = radii_of(&scene, args.seed, positions.len())?;
        (positions, radii, None)
    } else {
        let simulation = scene::start(&scene, args.seed, 1, None)?;
        match scene::pour(
            context,
            &scene,
            args.seed,
            simulation,
            &Keep::Nothing,
            &mut Observer::new(&scene),
            &mut SideFiles::default(),
        )? {
            Some(pour) => {
                if matches!(pour.status, Status::Unhealthy | Status::Jammed) {
                    note(&format!("warning: the pour that is drawn is {}", pour.status));
                }
                (pour.positions, pour.radii, pour.convex)
            }
            None => return Ok(Outcome::Stopped),
        }
    };
    let drawn = Drawn { positions: &positions, radii: &radii, convex: convex.as_ref(), bed: None };
    let view = match further {
        Some(further) => capture_from(further, &drawn)?,
        None => capture(&scene.camera, &drawn, args.seed)?,
    };
    write_view(&args.out, &view, args.depth_unit, &scene.camera)?;
    if args.json {
        print_json(&as_json(&args.out, &view))?;
    } else {
        print_line(&in_words(&args.out, &view))?;
    }
    Ok(Outcome::Done)
}

/// Radii of so many centres of a pour, which keep their order `[m]`: those of all grains of the scene or of the grains
/// at its start, or any number of one radius.
fn radii_of(scene: &Scene, seed: u64, count: usize) -> anyhow::Result<Vec<f64>> {
    Room::of_pour(scene, None).require(None)?;
    let simulation = Simulation::new(scene, seed)?;
    let (all, at_start) = (simulation.all_radii(), simulation.radii());
    if let Some(known) = [&all, &at_start].into_iter().find(|known| known.len() == count) {
        return Ok(known.clone());
    }
    match all.first() {
        Some(&radius) if all.iter().all(|other| *other == radius) => Ok(vec![radius; count]),
        _ => {
            let mut allowed = all.len().to_string();
            if at_start.len() != all.len() {
                allowed = format!("{} or {allowed}", at_start.len());
            }
            let problem = format!(
                "--positions must be {allowed} centres, as many as the scene has of grains that differ in size, got \
                 {count}"
            );
            Err(BadArgument(problem).into())
        }
    }
}

fn in_words(path: &Path, view: &View) -> String {
    match view {
        View::Depth(_, image) => {
            let (file, camera) = (path.display(), path.with_extension("toml"));
            let (width, height) = (image.width, image.height);
            format!("{file}: {width}x{height} depths, camera in {}", camera.display())
        }
        View::Heights(map) => {
            format!("{}: {}x{} heights", path.display(), map.width, map.height)
        }
    }
}

fn as_json(path: &Path, view: &View) -> Value {
    let file = path.display().to_string();
    match view {
        View::Depth(_, image) => json!({
            "file": file,
            "kind": "depth image",
            "camera": path.with_extension("toml").display().to_string(),
            "width": image.width,
            "height": image.height,
        }),
        View::Heights(map) => json!({
            "file": file,
            "kind": "height map",
            "width": map.width,
            "height": map.height,
            "resolution_m": [map.resolution_x, map.resolution_y],
        }),
    }
}

/// Refuses a file name whose ending does not go with the scene's camera, before anything is simulated.
///
/// # Errors
/// [`BadArgument`].
pub fn check_name(path: &Path, scene: &Scene) -> Result<(), BadArgument> {
    match scene.camera.projection {
        Projection::Pinhole => check_ending(path, "a pinhole camera", "png"),
        Projection::Orthographic => check_ending(path, "an orthographic camera", "npz"),
    }
}

fn find_view<'a>(scene: &'a Scene, name: &str) -> Result<&'a ViewSpec, BadArgument> {
    scene.views.iter().find(|view| view.name == name).ok_or_else(|| {
        let names: Vec<_> = scene.views.iter().map(|view| view.name.as_str()).collect();
        let known = if names.is_empty() { "it has none".to_owned() } else { names.join(", ") };
        BadArgument(format!("--view must be one of the scene's views ({known}), got {name:?}"))
    })
}

fn check_ending(path: &Path, kind: &str, ending: &str) -> Result<(), BadArgument> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending)) {
        return Ok(());
    }
    let path = path.display();
    Err(BadArgument(format!("{path}: the image of {kind} must be named .{ending}")))
}

/// Writes a depth image with its camera beside it, which states the threshold of the scene's, or a height map.
///
/// # Errors
/// What the file system or a depth unit that is too small says.
pub fn write_view(
    path: &Path,
    view: &View,
    depth_unit: f64,
    of_scene: &CameraSpec,
) -> anyhow::Result<()> {
    match view {
        View::Depth(camera, image) => {
            png::write_depth(path, image, depth_unit)?;
            let file = CameraFile::of(camera, depth_unit);
            let segmentation = file.segmentation.at_threshold_of(of_scene);
            CameraFile { segmentation, ..file }.save(&path.with_extension("toml"))?;
        }
        View::Heights(map) => write_height_map(path, map)?,
    }
    Ok(())
}
