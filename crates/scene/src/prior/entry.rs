//! A prior as TOML has it.

use serde::{Deserialize, Serialize};

use super::parameter::{Keys, Parameter, refuse};
use crate::distribution::Distribution;
use crate::error::SceneError;

/// A prior as it stands in a file.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) parameter: Vec<Entry>,
}

/// A parameter as it stands in a file: every key of every distribution, checked after reading.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Entry {
    path: String,
    distribution: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    low: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    high: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mean: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sd: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    value: Option<f64>,
}

impl Entry {
    pub(super) fn with(path: &str, distribution: &str, keys: Keys) -> Self {
        let Keys { low, high, mean, sd, value } = keys;
        Self {
            path: path.to_owned(),
            distribution: distribution.to_owned(),
            low,
            high,
            mean,
            sd,
            value,
        }
    }

    pub(super) fn of(parameter: &Parameter) -> Self {
        let mut entry = Self {
            path: parameter.path.clone(),
            distribution: parameter.distribution.name().to_owned(),
            ..Self::default()
        };
        match parameter.distribution {
            Distribution::Uniform { low, high } | Distribution::LogUniform { low, high } => {
                (entry.low, entry.high) = (Some(low), Some(high));
            }
            Distribution::Normal { mean, sd, low, high } => {
                (entry.mean, entry.sd) = (Some(mean), Some(sd));
                (entry.low, entry.high) = (low, high);
            }
            Distribution::Fixed { value } => entry.value = Some(value),
        }
        entry
    }

    pub(super) fn into_parameter(mut self) -> Result<Parameter, SceneError> {
        let distribution = match self.distribution.as_str() {
            "uniform" => Distribution::Uniform { low: self.low()?, high: self.high()? },
            "log_uniform" => Distribution::LogUniform { low: self.low()?, high: self.high()? },
            "normal" => Distribution::Normal {
                mean: self.needs("mean", |e| e.mean.take())?,
                sd: self.needs("sd", |e| e.sd.take())?,
                low: self.low.take(),
                high: self.high.take(),
            },
            "fixed" => Distribution::Fixed { value: self.needs("value", |e| e.value.take())? },
            other => {
                let allowed = "one of uniform, log_uniform, normal, fixed";
                return Err(refuse(&self.path, "distribution", format!("{other:?}"), allowed));
            }
        };
        // What the distribution has not taken is a slip, perhaps of the distribution's name.
        let left = [
            ("low", self.low),
            ("high", self.high),
            ("mean", self.mean),
            ("sd", self.sd),
            ("value", self.value),
        ];
        if let Some((key, Some(got))) = left.into_iter().find(|(_, value)| value.is_some()) {
            let got = format!("{got} for {}", distribution.name());
            return Err(refuse(&self.path, key, got, "absent for this distribution"));
        }
        Ok(Parameter { path: self.path, distribution })
    }

    fn low(&mut self) -> Result<f64, SceneError> {
        self.needs("low", |entry| entry.low.take())
    }

    fn high(&mut self) -> Result<f64, SceneError> {
        self.needs("high", |entry| entry.high.take())
    }

    fn needs(
        &mut self,
        key: &'static str,
        take: fn(&mut Self) -> Option<f64>,
    ) -> Result<f64, SceneError> {
        let allowed = "given for this distribution";
        take(self).ok_or_else(|| {
            refuse(&self.path, key, format!("none for {}", self.distribution), allowed)
        })
    }
}
