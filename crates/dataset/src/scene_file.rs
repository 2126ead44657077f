//! Scenes and priors from files.

use std::path::Path;

use granulcal_dem::Scene;

use crate::{DatasetError, Prior, files};

/// Reads a scene.
///
/// # Errors
/// [`DatasetError::Io`] for a file that cannot be read, [`DatasetError::Scene`] for one that is no scene.
pub fn load_scene(path: &Path) -> Result<Scene, DatasetError> {
    Scene::from_toml(&files::read_text(path)?)
        .map_err(|source| DatasetError::Scene { path: path.to_owned(), source })
}

/// Reads a prior.
///
/// # Errors
/// [`DatasetError::Io`] for a file that cannot be read, [`DatasetError::Toml`] for one that is no
/// TOML of a prior, [`DatasetError::Prior`] for a parameter that cannot be.
pub fn load_prior(path: &Path) -> Result<Prior, DatasetError> {
    Prior::from_toml(&files::read_text(path)?).map_err(|error| match error {
        DatasetError::PriorToml(source) => {
            DatasetError::Toml { path: path.to_owned(), what: "prior", source }
        }
        other => other,
    })
}
