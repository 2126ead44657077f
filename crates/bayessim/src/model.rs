//! A trained model, as a folder.

use std::path::Path;
use std::sync::Arc;

use granulcal_dataset::read_file;
use granulcal_scene::Prior;

use crate::ModelError;
use crate::average::Average;
use crate::coordinates::Coordinates;
use crate::damage;
use crate::document::Document;
use crate::emulated::Emulated;
use crate::misfit::{Misfit, MisfitReference};
use crate::network::Network;
use crate::posterior::{Evidence, Posterior, Warning};
use crate::standardiser::Standardiser;
use crate::stated_law::StatedLaw;
use crate::tensors::Tensors;

const DOCUMENT: &str = "model.json";
const TENSORS: &str = "weights.safetensors";

/// What `granulcal train` made.
#[derive(Debug)]
pub struct Model {
    /// Prior of the training.
    pub prior: Prior,
    /// Names of the statistics that an observation has, in order.
    pub x_names: Vec<String>,
    /// Scene of the training, TOML.
    pub scene_toml: Option<String>,
    /// Law of the solver that the pours of the training follow.
    pub law: StatedLaw,
    /// Whether the model passed its own check; `None` if there was none.
    pub is_calibrated: Option<bool>,
    /// Whether its files say what they hash to, and do; those of before there were hashes do not.
    pub is_verified: bool,
    coordinates: Arc<Coordinates>,
    standardiser: Standardiser,
    emulated: Emulated,
    misfit: MisfitReference,
    network: Option<Network>,
    average: Average,
}

impl Model {
    /// Reads a folder.
    ///
    /// # Errors
    /// Every [`ModelError`] but the one of observations: a file that is missing, damaged, or of another version.
    pub fn load(folder: &Path) -> Result<Self, ModelError> {
        let read = |name: &str| read_file(&folder.join(name)).map_err(ModelError::File);
        Self::read(folder, &read(DOCUMENT)?, &read(TENSORS)?)
    }

    /// Reads the bytes of the document and of the tensors; `folder` is their name in messages.
    ///
    /// # Errors
    /// As [`Model::load`].
    pub fn read(folder: &Path, text: &[u8], bytes: &[u8]) -> Result<Self, ModelError> {
        let path = folder.join(DOCUMENT);
        let document = Document::parse(text, &path)?;
        let prior = Prior::from_toml(&document.prior_toml)
            .map_err(|e| ModelError::Prior { path, source: Box::new(e) })?;
        let coordinates = Arc::new(Coordinates::of(&prior));
        let (p, s) = (coordinates.dimension(), document.x_names.len());
        let path = folder.join(TENSORS);
        let is_verified = damage::verify(bytes, &path, &folder.join(DOCUMENT), text)?;
        let tensors = Tensors::of(bytes, &path)?;
        let network = if document.has_network {
            Some(Network::read(&tensors, &document.config, p, s)?)
        } else {
            None
        };
        let features = Some(document.config.emulator_features);
        Ok(Self {
            standardiser: Standardiser::read(&tensors, s)?,
            emulated: Emulated::read(&tensors, &coordinates, s, &document.emulator, features)?,
            misfit: MisfitReference::read(&tensors, s)?,
            coordinates,
            network,
            average: document.average(),
            prior,
            x_names: document.x_names,
            scene_toml: document.scene_toml,
            law: document.law,
            is_calibrated: document.is_calibrated,
            is_verified,
        })
    }

    /// Whether any parameters explain one pour, or several of one material; asked before the posterior, which
    /// answers under the model, right or wrong.
    ///
    /// # Errors
    /// As [`Model::posterior`].
    pub fn misfit(&self, x: &[Vec<f64>]) -> Result<Misfit, ModelError> {
        self.check(x)?;
        let z: Vec<_> = x.iter().map(|row| self.standardiser.apply_unclipped(row)).collect();
        Ok(self.emulated.misfit(&self.misfit, &z, &self.x_names))
    }

    /// The posterior given one pour, or several of one material, as statistics in own units.
    ///
    /// # Errors
    /// [`ModelError::Observation`] for no pour, another number of statistics, or one that is not finite.
    pub fn posterior(&self, x: &[Vec<f64>]) -> Result<Posterior, ModelError> {
        self.check(x)?;
        let z: Vec<_> = x.iter().map(|row| self.standardiser.apply(row)).collect();
        let mixtures = match &self.network {
            Some(network) if self.average.network > 0.0 => {
                z.iter().map(|z| network.mixture(z)).collect()
            }
            _ => Vec::new(),
        };
        let conditions = vec![(self.emulated.clone(), z)];
        let evidence = Evidence { conditions, mixtures, average: self.average };
        let mut found = Posterior::of(&self.coordinates, evidence);
        found.warnings.splice(..0, self.out_of_range(x));
        Ok(found)
    }

    fn check(&self, x: &[Vec<f64>]) -> Result<(), ModelError> {
        let wrong =
            |allowed: String, found: String| Err(ModelError::Observation { allowed, found });
        let count = self.x_names.len();
        if x.is_empty() {
            return wrong("at least one pour".to_owned(), "none".to_owned());
        }
        for row in x {
            if row.len() != count {
                return wrong(format!("{count} statistics"), row.len().to_string());
            }
            if let Some(bad) = row.iter().position(|value| !value.is_finite()) {
                let found = format!("{} = {}", self.x_names[bad], row[bad]);
                return wrong("finite".to_owned(), found);
            }
        }
        Ok(())
    }

    fn out_of_range(&self, x: &[Vec<f64>]) -> Vec<Warning> {
        let mut found = Vec::new();
        for (pour, row) in x.iter().enumerate() {
            for (i, &value) in row.iter().enumerate() {
                let (low, high) = (self.standardiser.low[i], self.standardiser.high[i]);
                if value < low || value > high {
                    let name = self.x_names[i].clone();
                    found.push(Warning::OutOfRange { pour, name, value, low, high });
                }
            }
        }
        found
    }
}
