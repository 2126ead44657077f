//! How much the posteriors of emulator and network count: theory, section "The average of both".

use serde::Deserialize;

/// Most that emulator or network may count.
const LARGEST_WEIGHT: f64 = 1e6;

/// What is averaged.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "lowercase")]
pub enum Form {
    /// Log densities: `p L^a (q/p)^b`.
    Geometric,
    /// Densities: what model files of version 3 mean.
    Arithmetic,
}

/// The weights of both.
#[derive(Clone, Copy, Debug)]
pub struct Average {
    /// What is averaged.
    pub form: Form,
    /// a; 0: the network alone.
    pub emulator: f64,
    /// b; 0: the emulator alone.
    pub network: f64,
}

impl Average {
    /// The average of two logarithms.
    pub fn of(&self, emulated: f64, learnt: f64) -> f64 {
        // What does not count may be infinite.
        let emulated = if self.emulator > 0.0 { self.emulator * emulated } else { 0.0 };
        emulated + self.network * learnt
    }

    /// Which weight is none, or is one of a network that the model has not.
    pub fn wrong(&self, has_network: bool) -> Option<(&'static str, f64)> {
        let largest = if self.form == Form::Arithmetic { 1.0 } else { LARGEST_WEIGHT };
        let is_weight = |value: f64| (0.0..=largest).contains(&value);
        if !is_weight(self.emulator) || (self.emulator == 0.0 && self.network == 0.0) {
            return Some(("emulator_weight", self.emulator));
        }
        let is_unfounded = self.network > 0.0 && !has_network;
        (!is_weight(self.network) || is_unfounded).then_some(("network_weight", self.network))
    }
}
