//! What a data set was made from, kept with every file of it.

use std::path::Path;

use granulcal_scene::{Prior, Scene, SceneError};

use crate::{DatasetError, ObservedStatistic, observed_statistics, scene_file};

/// The version of granulcal that writes.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Scene, prior, version and seed: together they determine every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The scene before the prior's parameters are set.
    pub scene: Scene,
    /// What is drawn.
    pub prior: Prior,
    /// The version of granulcal that wrote the rows.
    pub version: String,
    /// The seed of the data set.
    pub seed: u64,
    pub(crate) scene_toml: String,
    pub(crate) prior_toml: String,
}

impl Header {
    /// The header of rows that are written now.
    ///
    /// # Errors
    /// [`DatasetError::PriorDoesNotFit`] if the prior names what the scene has not.
    pub fn new(scene: &Scene, prior: &Prior, seed: u64) -> Result<Self, DatasetError> {
        scene.check().map_err(|e| DatasetError::Simulation(e.into()))?;
        prior.check(scene).map_err(DatasetError::Prior)?;
        Ok(Self {
            scene: scene.clone(),
            prior: prior.clone(),
            version: VERSION.to_owned(),
            seed,
            scene_toml: scene.to_toml().map_err(|e| DatasetError::Simulation(e.into()))?,
            prior_toml: prior.to_toml().map_err(DatasetError::Prior)?,
        })
    }

    /// The statistics that the scene observes.
    pub fn observed(&self) -> Vec<ObservedStatistic> {
        observed_statistics(&self.scene)
    }

    /// The header that stands in the file at `path`.
    pub(crate) fn parse(
        path: &Path,
        scene_toml: &str,
        prior_toml: &str,
        version: String,
        seed: u64,
    ) -> Result<Self, DatasetError> {
        let wrong = |source| DatasetError::Scene { path: path.to_owned(), source };
        let mut scene = Scene::parse(scene_toml).map_err(wrong)?;
        // Rows can be read where the scene's meshes are not; who simulates it is told.
        if scene_file::fill(&mut scene, Path::new("")).is_ok() {
            scene.check().map_err(wrong)?;
        }
        Ok(Self {
            scene,
            prior: Prior::from_toml(prior_toml).map_err(|error| match error {
                SceneError::PriorToml(source) => {
                    DatasetError::Toml { path: path.to_owned(), what: "prior", source }
                }
                other => {
                    DatasetError::content(path, "the prior", other.to_string(), "one that can be")
                }
            })?,
            version,
            seed,
            scene_toml: scene_toml.to_owned(),
            prior_toml: prior_toml.to_owned(),
        })
    }

    /// Refuses another header than `self`, which stands at `path`, and names the first difference.
    ///
    /// # Errors
    /// [`DatasetError::Differs`].
    pub(crate) fn require_same(&self, path: &Path, given: &Self) -> Result<(), DatasetError> {
        let differs = |what: String, found: String, given: String| {
            Err(DatasetError::Differs { path: path.to_owned(), what, found, given })
        };
        let difference = self.scene.first_difference(&given.scene);
        if let Some((key, found, given)) =
            difference.map_err(|e| DatasetError::Simulation(e.into()))?
        {
            return differs(format!("scene.{key}"), found, given);
        }
        if self.prior != given.prior {
            let (found, given) = (describe(&self.prior), describe(&given.prior));
            return differs("the prior".to_owned(), found, given);
        }
        if self.seed != given.seed {
            return differs("the seed".to_owned(), self.seed.to_string(), given.seed.to_string());
        }
        if self.version != given.version {
            let what = "the version of granulcal".to_owned();
            return differs(what, self.version.clone(), given.version.clone());
        }
        Ok(())
    }
}

fn describe(prior: &Prior) -> String {
    let of = |p: &granulcal_scene::Parameter| format!("{} {:?}", p.path, p.distribution);
    prior.parameters().iter().map(of).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_difference_is_named() {
        let prior = Prior::default();
        let scene = Scene::funnel(0.12);
        let header = Header::new(&scene, &prior, 1).unwrap();
        let path = Path::new("data");
        header.require_same(path, &header.clone()).unwrap();
        let message = |other: Header| header.require_same(path, &other).unwrap_err().to_string();

        let changed = scene.with("material.restitution", 0.3).unwrap();
        let text = message(Header::new(&changed, &prior, 1).unwrap());
        assert!(text.contains("scene.material.restitution is 0.5, but 0.3 is given"), "{text}");
        let text = message(Header::new(&scene, &prior, 2).unwrap());
        assert!(text.contains("the seed is 1, but 2 is given"), "{text}");
        let text = message(Header { version: "9.9.9".to_owned(), ..header.clone() });
        assert!(text.contains("9.9.9"), "{text}");
    }
}
