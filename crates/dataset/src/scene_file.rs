//! Scenes and priors from files.

use std::path::Path;
use std::sync::Arc;

use granulcal_scene::{Motion, Prior, Scene, SceneError};

use crate::readable::toml_error;
use crate::{DatasetError, files, mesh_file, trajectory_file};

/// Reads a scene with the meshes and trajectories that it names; their paths are from its folder.
///
/// # Errors
/// [`DatasetError::Io`] for a file that cannot be read, [`DatasetError::Toml`] or [`DatasetError::Scene`] for one that
/// is no scene, [`DatasetError::Content`] for a mesh or a trajectory that is none, or a mesh that is not the one it
/// was.
pub fn load_scene(path: &Path) -> Result<Scene, DatasetError> {
    let wrong = |source| DatasetError::Scene { path: path.to_owned(), source };
    let text = files::read_text(path)?;
    let mut scene = Scene::parse(&text).map_err(|error| match error {
        SceneError::Toml(source) => toml_error(path, "scene", &text, source),
        other => wrong(other),
    })?;
    fill(&mut scene, path.parent().unwrap_or(Path::new("")))?;
    scene.check().map_err(wrong)?;
    Ok(scene)
}

/// A scene of this text; relative paths of its meshes and trajectories are from `folder`.
///
/// # Errors
/// As [`load_scene`], but for [`DatasetError::Io`] of the scene itself; [`DatasetError::Simulation`] for what is no
/// scene.
pub fn scene_from_text(text: &str, folder: &Path) -> Result<Scene, DatasetError> {
    let mut scene = Scene::parse(text).map_err(DatasetError::refused)?;
    fill(&mut scene, folder)?;
    scene.check().map_err(DatasetError::refused)?;
    Ok(scene)
}

/// Reads the files that a scene names, and makes their paths whole.
pub(crate) fn fill(scene: &mut Scene, folder: &Path) -> Result<(), DatasetError> {
    let whole = |name: &str| {
        let path = folder.join(name);
        std::path::absolute(&path).unwrap_or(path)
    };
    for file in scene.mesh_files() {
        let path = whole(&file.file);
        let (mesh, hash) = mesh_file::read(&path)?;
        if let Some(known) = file.hash.as_ref().filter(|known| **known != hash) {
            let what = "the mesh's hash";
            return Err(DatasetError::content(&path, what, hash, format!("{known}, as it was")));
        }
        file.file = path.display().to_string();
        file.hash = Some(hash);
        file.mesh = Some(Arc::new(mesh));
    }
    for motion in scene.motions() {
        if let Motion::Trajectory { file, knots } = motion
            && let Some(name) = file.take()
        {
            if !knots.is_empty() {
                let (one, other) = ("motion.file", "motion.knots");
                return Err(DatasetError::refused(SceneError::Exclude { one, other }));
            }
            *knots = trajectory_file::read(&whole(&name))?;
        }
    }
    Ok(())
}

/// Reads a prior.
///
/// # Errors
/// [`DatasetError::Io`] for a file that cannot be read, [`DatasetError::Toml`] for one that is no
/// TOML of a prior, [`DatasetError::Prior`] for a parameter that cannot be.
pub fn load_prior(path: &Path) -> Result<Prior, DatasetError> {
    let text = files::read_text(path)?;
    Prior::from_toml(&text).map_err(|error| match error {
        SceneError::PriorToml(source) => toml_error(path, "prior", &text, source),
        other => DatasetError::Prior(other),
    })
}
