//! Scenes and priors as arguments name them, and one pour of a scene.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use granulcal_dataset::{
    DatasetError, Observer, POLL_INTERVAL, Prior, Room, load_prior, load_scene, load_sensor,
    read_checkpoint_header, record_pour, resume_checkpoint, write_checkpoint,
};
use granulcal_dem::{Pour, Simulation};
use granulcal_scene::Scene;

use crate::args::{SceneArgs, SceneChanges};
use crate::context::Context;
use crate::interrupt::keeps_going;
use crate::outcome::BadArgument;
use crate::progress::PourProgress;
use crate::sides::SideFiles;

/// Height of the funnel's tip of the built-in scene, the paper's `[m]`.
const FUNNEL_HEIGHT: f64 = 0.12;
/// Drop height of the built-in scene `[m]`.
const DROP_HEIGHT: f64 = 0.1;
/// How like a built-in word another must be to be meant for it: 1 for the same, 0 for no letter in its place.
const NEAR: f64 = 0.6;

/// The scene that the arguments describe.
///
/// # Errors
/// What is wrong with the file, a path or a value.
pub fn load(args: &SceneArgs) -> anyhow::Result<Scene> {
    changed(&args.scene, &args.with)
}

/// Refuses what the Python package alone does, which does not come here then: pours that are made elsewhere.
///
/// # Errors
/// [`BadArgument`] if a value is given.
pub fn refuse_elsewhere(option: &str, value: Option<&str>) -> Result<(), BadArgument> {
    match value {
        Some(value) => Err(BadArgument(format!(
            "{option} {value:?}: that is done by `granulcal` of the Python package alone"
        ))),
        None => Ok(()),
    }
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
        _ => {
            refuse_absent(name, "scene", &["funnel", "drop"])?;
            load_scene(name)?
        }
    })
}

/// Refuses what is no file, and says what is built in.
fn refuse_absent(name: &Path, what: &str, built_in: &[&str]) -> Result<(), BadArgument> {
    if name.exists() {
        return Ok(());
    }
    let word = name.to_string_lossy();
    let near = |known: &&&str| strsim::normalized_damerau_levenshtein(&word, known) >= NEAR;
    let meant = match built_in.iter().find(near) {
        Some(meant) => format!("; did you mean {meant}?"),
        None => String::new(),
    };
    let known = built_in.join(", ");
    Err(BadArgument(format!("{word:?} is no file and no built-in {what} ({known}){meant}")))
}

/// The prior that an argument names.
///
/// # Errors
/// What is wrong with the file.
pub fn prior(path: &Path) -> anyhow::Result<Prior> {
    if path.to_str() == Some("default") {
        return Ok(Prior::default());
    }
    refuse_absent(path, "prior", &["default"])?;
    load_prior(path).with_context(|| format!("reading {}", path.display()))
}

/// What is kept of a pour while it runs.
pub enum Keep<'a> {
    /// Nothing.
    Nothing,
    /// Frames, in an MCAP file.
    Film {
        /// The file.
        path: &'a Path,
        /// Frames per simulated second.
        fps: f64,
    },
    /// The newest state, to go on from.
    Checkpoint {
        /// The file.
        path: &'a Path,
        /// Least time between two writes.
        every: Duration,
    },
}

/// A scene at its start, or at a checkpoint, on so many threads.
///
/// # Errors
/// What is wrong with the scene or the checkpoint.
pub fn start(
    scene: &Scene,
    seed: u64,
    threads: usize,
    resume: Option<&Path>,
) -> Result<Simulation, DatasetError> {
    Room::of_pour(scene, None).require(None)?;
    let simulation = Simulation::new(scene, seed)
        .and_then(|simulation| simulation.with_threads(threads))
        .map_err(DatasetError::Simulation)?;
    if let Some(path) = resume {
        resume_checkpoint(path, simulation)
    } else {
        simulation.check_start().map_err(DatasetError::Simulation)?;
        Ok(simulation)
    }
}

/// Refuses to begin a pour anew over a checkpoint that is further on with it.
///
/// One of another pour, or that nobody can go on from, is replaced as any output of a command is.
fn require_no_further(
    path: &Path,
    scene: &Scene,
    seed: u64,
    simulation: &Simulation,
) -> Result<(), DatasetError> {
    let Ok(kept) = read_checkpoint_header(path) else { return Ok(()) };
    let is_same = kept.seed == seed
        && kept.scene.first_difference(scene).is_ok_and(|difference| difference.is_none());
    if !is_same || kept.time() <= simulation.time() {
        return Ok(());
    }
    let (shown, at, begun) = (path.display(), kept.time(), simulation.time());
    Err(DatasetError::Output {
        argument: "--checkpoint".to_owned(),
        reason: format!(
            "{shown} has this pour at {at:.3} s, and going on from {begun:.3} s would replace it; go on from it with \
             --resume {shown}, or delete it"
        ),
    })
}

/// Simulates `scene` from where `simulation` is to its end, before the eyes of `observer`; `None` when the user stopped
/// it.
///
/// # Errors
/// What is wrong with the file that is kept, before anything is simulated or when the user stops; later on it is kept
/// in `sides`.
pub fn pour(
    context: &Context,
    scene: &Scene,
    seed: u64,
    simulation: Simulation,
    keep: &Keep,
    observer: &mut Observer,
    sides: &mut SideFiles,
) -> Result<Option<Pour>, DatasetError> {
    let progress = PourProgress::new(context);
    let horizon = scene.end.horizon;
    let mut watch = |time: f64| {
        progress.show(time, horizon);
        keeps_going()
    };
    let pour = match *keep {
        Keep::Film { path, fps } => {
            let filmed = record_pour(simulation, scene, seed, fps, path, observer, &mut watch)?;
            filmed.map(|(pour, film)| {
                sides.keep(film);
                pour
            })
        }
        Keep::Nothing => run(simulation, observer, &mut watch, &mut |_, _| Ok(()))?,
        Keep::Checkpoint { path, every } => {
            require_no_further(path, scene, seed, &simulation)?;
            let mut last = None;
            let mut failed = None;
            let pour = run(simulation, observer, &mut watch, &mut |simulation, must| {
                if must || last.is_none_or(|last: Instant| last.elapsed() >= every) {
                    match write_checkpoint(path, simulation) {
                        Ok(()) => failed = None,
                        // Nothing is lost yet.
                        Err(error) if last.is_none() => return Err(error),
                        Err(error) => {
                            if failed.is_none() {
                                tracing::warn!("{error}; the pour goes on without this checkpoint");
                            }
                            failed = Some(error);
                        }
                    }
                    last = Some(Instant::now());
                }
                Ok(())
            })?;
            match (failed, &pour) {
                (Some(error), None) => return Err(error),
                (Some(error), Some(_)) => sides.keep(Err(error)),
                (None, _) => {}
            }
            pour
        }
    };
    progress.finish();
    Ok(pour)
}

/// Goes on to the end, or until `watch` says no; `keep` is called each time, and with true at the last.
fn run(
    mut simulation: Simulation,
    observer: &mut Observer,
    watch: &mut dyn FnMut(f64) -> bool,
    keep: &mut dyn FnMut(&Simulation, bool) -> Result<(), DatasetError>,
) -> Result<Option<Pour>, DatasetError> {
    loop {
        let has_ended = simulation.ended().is_some();
        let goes_on = !has_ended && watch(simulation.time());
        keep(&simulation, !goes_on)?;
        if !goes_on {
            return Ok(has_ended.then(|| simulation.into_pour()));
        }
        observer.advance(&mut simulation, POLL_INTERVAL)?;
    }
}
