//! `model.json`: what of it is needed here.

use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use crate::ModelError;

/// The version that can be read.
pub const VERSION: u64 = 3;
const FORMAT: &str = "granulcal-bayessim";

#[derive(Debug, Deserialize)]
pub struct Document {
    pub prior_toml: String,
    pub x_names: Vec<String>,
    pub config: Config,
    pub scene_toml: Option<String>,
    pub has_network: bool,
    pub emulator_weight: f64,
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

#[derive(Debug, Deserialize)]
pub struct EmulatorScalars {
    pub widening: f64,
    pub leading_degrees: f64,
    pub axis_count: usize,
}

impl Document {
    pub fn parse(text: &str, path: &Path) -> Result<Self, ModelError> {
        let wrong = |source| ModelError::Document { path: path.to_owned(), source };
        let value: Value = serde_json::from_str(text).map_err(wrong)?;
        let content = |what: &str, allowed: String, found: String| ModelError::Content {
            path: path.to_owned(),
            what: what.to_owned(),
            allowed,
            found,
        };
        if value["format"] != FORMAT {
            return Err(content("format", FORMAT.to_owned(), value["format"].to_string()));
        }
        let version = &value["version"];
        if *version != VERSION {
            let is_newer = version.as_u64().is_some_and(|version| version > VERSION);
            return Err(ModelError::Version {
                path: path.to_owned(),
                allowed: VERSION,
                found: version.to_string(),
                made_by: value["made_by"].as_str().unwrap_or("an earlier granulcal").to_owned(),
                advice: if is_newer { "update granulcal" } else { "train the model again" },
            });
        }
        let document: Self = serde_json::from_value(value).map_err(wrong)?;
        let weight = document.emulator_weight;
        if !(0.0..=1.0).contains(&weight) || (weight < 1.0 && !document.has_network) {
            let allowed = "between 0 and 1, and 1 without a network".to_owned();
            return Err(content("emulator_weight", allowed, weight.to_string()));
        }
        let axes = document.emulator.axis_count;
        if axes == 0 || axes > document.x_names.len() {
            let allowed = format!("between 1 and {}", document.x_names.len());
            return Err(content("axis_count", allowed, axes.to_string()));
        }
        Ok(document)
    }
}
