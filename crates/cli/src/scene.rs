//! Scenes and priors as arguments name them, and one pour of a scene.

use std::path::Path;

use anyhow::Context as _;
use granulcal_dataset::{DatasetError, Prior, load_prior, load_scene, load_sensor, record_pour};
use granulcal_dem::{Pour, Scene, Simulation};

use crate::args::{SceneArgs, SceneChanges};
use crate::context::{Context, keeps_going};
use crate::progress::PourProgress;

/// Height of the funnel's tip of the built-in scene, the paper's `[m]`.
const FUNNEL_HEIGHT: f64 = 0.12;
/// Drop height of the built-in scene `[m]`.
const DROP_HEIGHT: f64 = 0.1;
/// Simulated time between two looks at the clock and at Ctrl-C `[s]`.
const GLANCE: f64 = 0.01;

/// The scene that the arguments describe.
///
/// # Errors
/// What is wrong with the file, a path or a value.
pub fn load(args: &SceneArgs) -> anyhow::Result<Scene> {
    changed(&args.scene, &args.with)
}

/// The scene of that name, with changes.
///
/// # Errors
/// What is wrong with the file, a path or a value.
pub fn changed(name: &Path, with: &SceneChanges) -> anyhow::Result<Scene> {
    let mut scene = named(name)?;
    if let Some(preset) = with.preset {
        scene.preset = preset;
    }
    if let Some(path) = &with.sensor {
        scene.camera.sensor = Some(load_sensor(path)?);
    }
    let changes: Vec<_> =
        with.changes.iter().map(|(path, value)| (path.as_str(), *value)).collect();
    scene.set(&changes).with_context(|| format!("scene {}", name.display()))?;
    Ok(scene)
}

/// The scene of that name.
///
/// # Errors
/// What is wrong with the file.
pub fn named(name: &Path) -> anyhow::Result<Scene> {
    Ok(match name.to_str() {
        Some("funnel") => Scene::funnel(FUNNEL_HEIGHT),
        Some("drop") => Scene::drop(DROP_HEIGHT),
        _ => load_scene(name)?,
    })
}

/// The prior that an argument names.
///
/// # Errors
/// What is wrong with the file.
pub fn prior(path: &Path) -> anyhow::Result<Prior> {
    match path.to_str() {
        Some("default") => Ok(Prior::default()),
        _ => load_prior(path).with_context(|| format!("reading {}", path.display())),
    }
}

/// Where a pour is recorded, and how many frames a simulated second.
pub struct Film<'a> {
    /// The MCAP file.
    pub path: &'a Path,
    /// Frames per simulated second.
    pub fps: f64,
}

/// Simulates a scene to its end on so many threads; `None` when the user stopped it.
///
/// # Errors
/// What is wrong with the scene or the film.
pub fn pour(
    context: &Context,
    scene: &Scene,
    seed: u64,
    threads: usize,
    film: Option<&Film>,
) -> Result<Option<Pour>, DatasetError> {
    let progress = PourProgress::new(context);
    let horizon = scene.end.horizon;
    let mut watch = |time: f64| {
        progress.show(time, horizon);
        keeps_going()
    };
    let mut simulation = Simulation::new(scene, seed)
        .and_then(|simulation| simulation.with_threads(threads))
        .map_err(DatasetError::Simulation)?;
    let pour = if let Some(film) = film {
        record_pour(simulation, scene, seed, film.fps, film.path, &mut watch)?
    } else {
        while simulation.ended().is_none() && watch(simulation.time()) {
            simulation.advance(GLANCE);
        }
        simulation.ended().is_some().then(|| simulation.into_pour())
    };
    progress.finish();
    Ok(pour)
}
