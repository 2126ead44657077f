//! A trained model, as a folder.

use std::fs;
use std::path::Path;

use granulcal_dataset::Prior;

use crate::ModelError;
use crate::average::{Average, Form};
use crate::coordinates::Coordinates;
use crate::document::Document;
use crate::likelihood::{FEWEST_EFFECTIVE, Likelihood};
use crate::mixture::TruncatedMixture;
use crate::network::Network;
use crate::posterior::{Belief, Posterior, Tilted, Warning};
use crate::standardiser::Standardiser;
use crate::tensors::Tensors;
use crate::tilt::Tilt;

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
    /// Whether the model passed its own check; `None` if there was none.
    pub is_calibrated: Option<bool>,
    names: Vec<String>,
    coordinates: Coordinates,
    standardiser: Standardiser,
    likelihood: Likelihood,
    network: Option<Network>,
    average: Average,
}

impl Model {
    /// Reads a folder.
    ///
    /// # Errors
    /// Every [`ModelError`] but the one of observations: a file that is missing, damaged, or of another version.
    pub fn load(folder: &Path) -> Result<Self, ModelError> {
        let read = |name: &str| {
            let path = folder.join(name);
            match fs::read(&path) {
                Ok(bytes) => Ok((path, bytes)),
                Err(source) => Err(ModelError::Io { path, source }),
            }
        };
        let (path, text) = read(DOCUMENT)?;
        let document = Document::parse(&String::from_utf8_lossy(&text), &path)?;
        let prior = Prior::from_toml(&document.prior_toml)
            .map_err(|e| ModelError::Prior { path, source: Box::new(e) })?;
        let coordinates = Coordinates::of(&prior);
        let (p, s) = (coordinates.dimension(), document.x_names.len());
        let (path, bytes) = read(TENSORS)?;
        let tensors = Tensors::of(&bytes, &path)?;
        let network = if document.has_network {
            Some(Network::read(&tensors, &document.config, p, s)?)
        } else {
            None
        };
        let names = prior.free().iter().map(|&i| prior.names()[i].to_owned()).collect();
        Ok(Self {
            names,
            standardiser: Standardiser::read(&tensors, s)?,
            likelihood: Likelihood::read(&tensors, &document, &coordinates, p)?,
            coordinates,
            network,
            average: document.average(),
            prior,
            x_names: document.x_names,
            scene_toml: document.scene_toml,
            is_calibrated: document.is_calibrated,
        })
    }

    /// The posterior given one pour, or several of one material, as statistics in own units.
    ///
    /// A model that is a network takes one pour only.
    ///
    /// # Errors
    /// [`ModelError::Observation`] for no pour, another number of statistics, one that is not finite, or
    /// several pours where only the network can be asked.
    pub fn posterior(&self, x: &[Vec<f64>]) -> Result<Posterior<'_>, ModelError> {
        self.check(x)?;
        let mut warnings = self.out_of_range(x);
        let z: Vec<_> = x.iter().map(|row| self.standardiser.apply(row)).collect();
        let learnt = self.learnt(&z);
        let outside = learnt.iter().filter(|cut| cut.is_mostly_outside());
        warnings
            .extend(outside.map(|cut| Warning::MassOutsidePrior { inside: cut.log_mass.exp() }));
        let belief = self.belief(&z, learnt);
        if let Belief::Tilted(tilted) | Belief::Sum(tilted, ..) = &belief {
            let effective = tilted.density.effective_sample_size();
            if effective < FEWEST_EFFECTIVE {
                warnings.push(Warning::FewEffectiveDraws { effective });
            }
        }
        Ok(Posterior { coordinates: &self.coordinates, names: &self.names, belief, warnings })
    }

    /// The network's mixture of each pour, where it counts: an arithmetic average is of one pour.
    fn learnt(&self, z: &[Vec<f64>]) -> Vec<TruncatedMixture> {
        let average = self.average;
        match &self.network {
            Some(network)
                if average.network > 0.0 && (average.form == Form::Geometric || z.len() == 1) =>
            {
                let cut = |z| TruncatedMixture::cut(&self.coordinates, network.mixture(z));
                z.iter().map(|z| cut(z)).collect()
            }
            _ => Vec::new(),
        }
    }

    fn belief<'a>(&'a self, z: &[Vec<f64>], mut learnt: Vec<TruncatedMixture>) -> Belief<'a> {
        let average = self.average;
        let tilted = |tilt: Tilt<'a>| {
            let density = tilt.posterior(&self.coordinates);
            Tilted { tilt, density }
        };
        let tilt = || Tilt::of(&self.likelihood, z);
        if learnt.is_empty() {
            return Belief::Tilted(tilted(tilt()));
        }
        if average.emulator == 0.0 {
            return Belief::Learnt(learnt.remove(0));
        }
        match average.form {
            Form::Geometric => {
                let mixtures = learnt.into_iter().map(|cut| cut.mixture).collect();
                Belief::Tilted(tilted(tilt().averaged(mixtures, average)))
            }
            Form::Arithmetic => Belief::Sum(tilted(tilt()), learnt.remove(0), average.emulator),
        }
    }

    fn check(&self, x: &[Vec<f64>]) -> Result<(), ModelError> {
        let wrong =
            |allowed: String, found: String| Err(ModelError::Observation { allowed, found });
        let count = self.x_names.len();
        if x.is_empty() {
            return wrong("at least one pour".to_owned(), "none".to_owned());
        }
        if x.len() > 1 && self.average.emulator == 0.0 {
            let allowed = "one pour, for this model is a network alone".to_owned();
            return wrong(allowed, format!("{} pours", x.len()));
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
