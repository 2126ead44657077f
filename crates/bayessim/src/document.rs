//! `model.json`: what of it is needed here.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use crate::ModelError;
use crate::average::{Average, Form};
use crate::stated_law::StatedLaw;

/// The version that is written now.
const VERSION: u64 = 4;
/// The emulator's weight in such files is that of an arithmetic average.
const OLDER_VERSION: u64 = 3;
const VERSIONS: &str = "3 or 4";
/// Largest number of components, members or features.
const LARGEST_COUNT: usize = 1_000_000;
const FORMAT: &str = "granulcal-bayessim";

#[derive(Debug, Deserialize)]
pub struct Document {
    pub prior_toml: String,
    pub x_names: Vec<String>,
    pub config: Config,
    pub scene_toml: Option<String>,
    #[serde(default)]
    pub law: StatedLaw,
    pub has_network: bool,
    average: Form,
    emulator_weight: f64,
    network_weight: f64,
    pub emulator: EmulatorScalars,
    pub is_calibrated: Option<bool>,
}

#[derive(Debug, Deserialize)]
pub struct Config {
    pub components: usize,
    pub ensemble: usize,
    pub features: usize,
    pub emulator_features: usize,
}

/// Numbers of an emulator that are no arrays.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct EmulatorScalars {
    /// Factor on the noise, chosen by held-out pairs.
    pub widening: f64,
    /// Degrees of freedom of the noise of all signal axes.
    pub degrees: f64,
    /// The same of the leading ones.
    pub leading_degrees: f64,
    /// How many lead.
    pub axis_count: usize,
}

impl Document {
    pub fn parse(text: &[u8], path: &Path) -> Result<Self, ModelError> {
        let wrong = |source| ModelError::Document { path: path.to_owned(), source };
        let mut value: Value = serde_json::from_slice(text).map_err(wrong)?;
        let content = |what: &str, allowed: String, found: String| ModelError::Content {
            path: path.to_owned(),
            what: what.to_owned(),
            allowed,
            found,
        };
        if !value.is_object() {
            return Err(content(
                "the document",
                "an object".to_owned(),
                "something else".to_owned(),
            ));
        }
        if value["format"] != FORMAT {
            return Err(content("format", FORMAT.to_owned(), value["format"].to_string()));
        }
        let version = &value["version"];
        let is_older = *version == OLDER_VERSION;
        if !is_older && *version != VERSION {
            let is_newer = version.as_u64().is_some_and(|version| version > VERSION);
            return Err(ModelError::Version {
                path: path.to_owned(),
                allowed: VERSIONS,
                found: version.to_string(),
                made_by: value["made_by"].as_str().unwrap_or("an earlier granulcal").to_owned(),
                advice: if is_newer { "update granulcal" } else { "train the model again" },
            });
        }
        if let (true, Some(weight)) = (is_older, value["emulator_weight"].as_f64()) {
            value["average"] = "arithmetic".into();
            value["network_weight"] = (1.0 - weight).into();
        }
        let document: Self = serde_json::from_value(value).map_err(wrong)?;
        if let Some((name, weight)) = document.average().wrong(document.has_network) {
            let allowed = "a weight, and the network's 0 where there is none".to_owned();
            return Err(content(name, allowed, weight.to_string()));
        }
        let config = &document.config;
        for (name, found) in [
            ("components", config.components),
            ("ensemble", config.ensemble),
            ("features", config.features),
            ("emulator_features", config.emulator_features),
        ] {
            if !(1..=LARGEST_COUNT).contains(&found) {
                let allowed = format!("between 1 and {LARGEST_COUNT}");
                return Err(content(name, allowed, found.to_string()));
            }
        }
        let scalars = &document.emulator;
        for (name, found, low, high) in [
            ("widening", scalars.widening, 1e-3, 1e3),
            ("degrees", scalars.degrees, 0.1, 1e6),
            ("leading_degrees", scalars.leading_degrees, 0.1, 1e6),
        ] {
            if !(low..=high).contains(&found) {
                return Err(content(
                    name,
                    format!("between {low} and {high:e}"),
                    format!("{found:e}"),
                ));
            }
        }
        if document.x_names.is_empty() {
            return Err(content("x_names", "at least one name".to_owned(), "none".to_owned()));
        }
        let axes = document.emulator.axis_count;
        if axes == 0 || axes > document.x_names.len() {
            let allowed = format!("between 1 and {}", document.x_names.len());
            return Err(content("axis_count", allowed, axes.to_string()));
        }
        Ok(document)
    }

    /// How much emulator and network count.
    pub fn average(&self) -> Average {
        Average { form: self.average, emulator: self.emulator_weight, network: self.network_weight }
    }
}
