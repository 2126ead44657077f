//! Statistics to mean 0 and spread 1.

use crate::ModelError;
use crate::tensors::Tensors;

/// Per statistic an optional logarithm, then a shift and a scale.
#[derive(Clone, Debug)]
pub struct Standardiser {
    is_log: Vec<bool>,
    shift: Vec<f64>,
    scale: Vec<f64>,
    /// Smallest training value, the statistic's own unit.
    pub low: Vec<f64>,
    /// Largest training value, the statistic's own unit.
    pub high: Vec<f64>,
}

impl Standardiser {
    pub fn read(tensors: &Tensors, s: usize) -> Result<Self, ModelError> {
        Ok(Self {
            is_log: tensors.take("x_is_log", &[s])?.iter().map(|&flag| flag != 0.0).collect(),
            shift: tensors.take("x_shift", &[s])?,
            scale: tensors.take("x_scale", &[s])?,
            low: tensors.take("x_low", &[s])?,
            high: tensors.take("x_high", &[s])?,
        })
    }

    /// Standardised statistics; values beyond the training range are moved to it.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len())
            .map(|i| {
                let inside = x[i].clamp(self.low[i], self.high[i]);
                let warped = if self.is_log[i] { inside.ln() } else { inside };
                (warped - self.shift[i]) / self.scale[i]
            })
            .collect()
    }
}
