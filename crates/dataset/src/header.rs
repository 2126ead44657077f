//! What a data set was made from, kept with every file of it.

use std::path::Path;
use std::sync::Arc;

use granulcal_dem::{arithmetic, law_of};
use granulcal_scene::{Prior, Scene, SceneError};

use crate::{DatasetError, ObservedStatistic, observed_statistics, scene_file};

/// The version of granulcal that writes.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// The law of rows that another simulator made.
pub(crate) const FOREIGN_LAW: u32 = 0;

/// The arithmetic of rows of before it was written.
pub(crate) const FIRST_ARITHMETIC: u32 = 1;

/// Scene, prior, law, arithmetic, version and seed: together they determine every row.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// The scene before the prior's parameters are set.
    pub scene: Scene,
    /// What is drawn.
    pub prior: Prior,
    /// The version of granulcal that wrote the rows.
    pub version: String,
    /// The number of the solver's law that the rows follow, 0 for pours of another simulator; `None` for rows of before
    /// the law had a number.
    pub law: Option<u32>,
    /// The number of the arithmetic that the solver worked in; of another simulator's pours it says nothing.
    pub arithmetic: u32,
    /// The seed of the data set.
    pub seed: u64,
    pub(crate) scene_toml: String,
    pub(crate) prior_toml: String,
    /// What the two texts say.
    pub(crate) said: Arc<(Scene, Prior)>,
}

impl Header {
    /// The header of rows that are written now.
    ///
    /// # Errors
    /// [`DatasetError::Prior`] if the prior names what the scene has not.
    pub fn new(scene: &Scene, prior: &Prior, seed: u64) -> Result<Self, DatasetError> {
        scene.check().map_err(DatasetError::refused)?;
        prior.check(scene).map_err(DatasetError::Prior)?;
        Ok(Self {
            scene: scene.clone(),
            prior: prior.clone(),
            version: VERSION.to_owned(),
            law: Some(law_of_draws(scene, prior)),
            arithmetic: arithmetic(scene),
            seed,
            scene_toml: scene.to_toml().map_err(DatasetError::refused)?,
            prior_toml: prior.to_toml().map_err(DatasetError::Prior)?,
            said: Arc::new((scene.clone(), prior.clone())),
        })
    }

    /// The statistics that the scene observes.
    pub fn observed(&self) -> Vec<ObservedStatistic> {
        observed_statistics(&self.scene)
    }

    /// What a user of the rows must know of the law that they follow, unless it is today's or another simulator's.
    pub fn other_law(&self) -> Option<String> {
        let today = law_of_draws(&self.scene, &self.prior);
        match self.law {
            Some(law) if law == today || law == FOREIGN_LAW => None,
            law => Some(format!(
                "made by {}, which is not today's {today}: its pours are those of another simulator",
                law_text(law)
            )),
        }
    }

    /// The header that stands in the file at `path`.
    pub(crate) fn parse(
        path: &Path,
        scene_toml: &str,
        prior_toml: &str,
        version: String,
        (law, arithmetic): (Option<u32>, u32),
        seed: u64,
    ) -> Result<Self, DatasetError> {
        let wrong = |source| DatasetError::Scene { path: path.to_owned(), source };
        let mut scene = Scene::parse(scene_toml).map_err(wrong)?;
        // Rows can be read where the scene's meshes are not; who simulates it is told.
        if scene_file::fill(&mut scene, Path::new("")).is_ok() {
            scene.check().map_err(wrong)?;
        }
        let prior = Prior::from_toml(prior_toml).map_err(|error| match error {
            SceneError::PriorToml(source) => {
                DatasetError::Toml { path: path.to_owned(), what: "prior", source }
            }
            other => DatasetError::content(path, "the prior", other.to_string(), "one that can be"),
        })?;
        Ok(Self {
            said: Arc::new((scene.clone(), prior.clone())),
            scene,
            prior,
            version,
            law,
            arithmetic,
            seed,
            scene_toml: scene_toml.to_owned(),
            prior_toml: prior_toml.to_owned(),
        })
    }

    /// Refuses a header whose scene or prior was changed since it was made: its file would say one thing, and the rows
    /// have the columns of another.
    ///
    /// # Errors
    /// [`DatasetError::Argument`].
    pub(crate) fn require_unchanged(&self) -> Result<(), DatasetError> {
        let refuse = |what, got| {
            let allowed = "as it was read; Header::new makes a header of another";
            Err(DatasetError::Argument { what, got, allowed })
        };
        let (scene, prior) = &*self.said;
        let difference = scene.first_difference(&self.scene).map_err(DatasetError::refused)?;
        if let Some((key, read, given)) = difference {
            return refuse("the scene of the data set", format!("{key} {given} for {read}"));
        }
        if self.prior != *prior {
            return refuse("the prior of the data set", describe(&self.prior));
        }
        Ok(())
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
        if let Some((key, found, given)) = difference.map_err(DatasetError::refused)? {
            return differs(named(&key), found, given);
        }
        if self.prior != given.prior {
            let (found, given) = (describe(&self.prior), describe(&given.prior));
            return differs("the prior".to_owned(), found, given);
        }
        if self.seed != given.seed {
            return differs("the seed".to_owned(), self.seed.to_string(), given.seed.to_string());
        }
        if self.law != given.law {
            let what = "the law of the solver".to_owned();
            return differs(what, law_text(self.law), law_text(given.law));
        }
        if self.arithmetic != given.arithmetic {
            let what = "the arithmetic of the solver".to_owned();
            return differs(what, self.arithmetic.to_string(), given.arithmetic.to_string());
        }
        if self.version != given.version {
            let what = "the version of granulcal".to_owned();
            return differs(what, self.version.clone(), given.version.clone());
        }
        Ok(())
    }
}

/// The number of the law that pours of a scene follow with the effects that a prior draws.
fn law_of_draws(scene: &Scene, prior: &Prior) -> u32 {
    let draws = prior.names().into_iter().zip(prior.sample(0, 0));
    let effects = draws.filter(|(path, _)| path.starts_with("effects."));
    let with = |scene: Scene, (path, value): (&str, f64)| scene.with(path, value).unwrap_or(scene);
    law_of(&effects.fold(scene.clone(), with))
}

/// What a person calls a key of the scene: a mesh differs by the hash of its file.
fn named(key: &str) -> String {
    match key.strip_suffix(".shape.hash") {
        Some(wall) => format!("the mesh of scene.{wall} (the hash of its file)"),
        None => format!("scene.{key}"),
    }
}

fn law_text(law: Option<u32>) -> String {
    match law {
        None => "one of before laws had numbers".to_owned(),
        Some(FOREIGN_LAW) => "another simulator's".to_owned(),
        Some(law) => format!("law {law}"),
    }
}

fn describe(prior: &Prior) -> String {
    let of = |p: &granulcal_scene::Parameter| format!("{} {}", p.path, p.distribution);
    prior.parameters().iter().map(of).collect::<Vec<_>>().join("; ")
}

#[cfg(test)]
mod tests {
    use granulcal_dem::LAW;

    use super::*;

    #[test]
    fn the_law_is_that_of_the_drawn_effects() {
        let scene = Scene::drop(0.1);
        let law = |prior: &str| {
            let prior = Prior::from_toml(prior).unwrap();
            Header::new(&scene, &prior, 1).unwrap().law
        };
        let parameter = |path: &str, high: f64| {
            let numbers = format!("distribution = \"uniform\"\nlow = 0.0\nhigh = {high}\n");
            format!("[[parameter]]\npath = \"{path}\"\n{numbers}")
        };
        let friction = parameter("material.sliding_friction", 1.0);
        assert_eq!(law(&friction), Some(LAW));
        let sizes = parameter("effects.polydispersity.cv", 0.2);
        assert_eq!(law(&format!("{friction}{sizes}")), Some(5));
    }

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
        assert_eq!(named("walls.0.shape.hash"), "the mesh of scene.walls.0 (the hash of its file)");
        let text = message(Header::new(&scene, &prior, 2).unwrap());
        assert!(text.contains("the seed is 1, but 2 is given"), "{text}");
        let text = message(Header { law: None, ..header.clone() });
        assert!(text.contains("the law of the solver is law"), "{text}");
        assert!(text.contains("one of before laws had numbers is given"), "{text}");
        let text = message(Header { arithmetic: 99, ..header.clone() });
        assert!(text.contains("the arithmetic of the solver is") && text.contains("99"), "{text}");
        let text = message(Header { version: "9.9.9".to_owned(), ..header.clone() });
        assert!(text.contains("9.9.9"), "{text}");
    }

    #[test]
    fn rows_of_another_law_are_told() {
        let header = Header::new(&Scene::drop(0.1), &Prior::default(), 1).unwrap();
        let told = |law| Header { law, ..header.clone() }.other_law();
        assert_eq!(told(Some(LAW)), None);
        assert_eq!(told(Some(FOREIGN_LAW)), None);
        assert!(told(Some(LAW - 1)).is_some_and(|text| text.contains("made by law 1")));
        assert!(told(None).is_some_and(|text| text.contains("before laws had numbers")));
    }
}
