//! A trained model, as a folder.

use std::path::Path;

use granulcal_dataset::read_file;
use granulcal_scene::Prior;

use crate::ModelError;
use crate::average::{Average, Form};
use crate::coordinates::Coordinates;
use crate::damage;
use crate::document::Document;
use crate::likelihood::{FEWEST_EFFECTIVE, Likelihood};
use crate::misfit::{Misfit, MisfitTest};
use crate::mixture::TruncatedMixture;
use crate::network::Network;
use crate::posterior::{Belief, Posterior, Tilted, Warning};
use crate::standardiser::Standardiser;
use crate::tensors::Tensors;
use crate::tilt::Tilt;

const DOCUMENT: &str = "model.json";
const TENSORS: &str = "weights.safetensors";
/// Odds against one shared material from which pours are said to contradict each other.
const LEAST_ODDS: f64 = 20.0;

/// What `granulcal train` made.
#[derive(Debug)]
pub struct Model {
    /// Prior of the training.
    pub prior: Prior,
    /// Names of the statistics that an observation has, in order.
    pub x_names: Vec<String>,
    /// Scene of the training, TOML.
    pub scene_toml: Option<String>,
    /// Law of the solver that the pours of the training follow, 0 for those of another simulator; `None` in models of
    /// before laws had numbers, and in those of no pours.
    pub law: Option<u32>,
    /// Whether the model passed its own check; `None` if there was none.
    pub is_calibrated: Option<bool>,
    /// Whether its files say what they hash to, and do; those of before there were hashes do not.
    pub is_verified: bool,
    names: Vec<String>,
    coordinates: Coordinates,
    standardiser: Standardiser,
    likelihood: Likelihood,
    misfit: MisfitTest,
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
        let coordinates = Coordinates::of(&prior);
        let (p, s) = (coordinates.dimension(), document.x_names.len());
        let path = folder.join(TENSORS);
        let is_verified = damage::verify(bytes, &path, &folder.join(DOCUMENT), text)?;
        let tensors = Tensors::of(bytes, &path)?;
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
            misfit: MisfitTest::read(&tensors, &document, p)?,
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
        Ok(self.misfit.test(&self.coordinates, &z, &self.x_names))
    }

    /// The posterior given one pour, or several of one material, as statistics in own units.
    ///
    /// # Errors
    /// [`ModelError::Observation`] for no pour, another number of statistics, or one that is not finite.
    pub fn posterior(&self, x: &[Vec<f64>]) -> Result<Posterior<'_>, ModelError> {
        self.check(x)?;
        let mut warnings = self.out_of_range(x);
        let z: Vec<_> = x.iter().map(|row| self.standardiser.apply(row)).collect();
        let learnt = self.learnt(&z);
        let outside = learnt.iter().filter(|cut| cut.is_mostly_outside());
        warnings
            .extend(outside.map(|cut| Warning::MassOutsidePrior { inside: cut.log_mass.exp() }));
        let log_masses: f64 = learnt.iter().map(|cut| cut.log_mass).sum();
        let is_product = self.average.emulator == 0.0 && learnt.len() > 1;
        let belief = self.belief(&z, learnt);
        if let (true, Belief::Tilted(tilted)) = (is_product, &belief) {
            let log_evidence_ratio = tilted.density.log_normaliser - log_masses;
            if log_evidence_ratio < -LEAST_ODDS.ln() {
                warnings.push(Warning::PoursDisagree { log_evidence_ratio });
            }
        }
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
                if average.network > 0.0
                    && (average.form == Form::Geometric
                        || average.emulator == 0.0
                        || z.len() == 1) =>
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
        if average.emulator == 0.0 && learnt.len() == 1 {
            return Belief::Learnt(learnt.remove(0));
        }
        if average.emulator == 0.0 {
            // The product of the pours' posteriors over prior^(k - 1).
            let average = Average { network: learnt.len() as f64, ..average };
            let mixtures = learnt.into_iter().map(|cut| cut.mixture).collect();
            return Belief::Tilted(tilted(tilt().averaged(mixtures, average)));
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
