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
        let found = Self {
            is_log: tensors.take("x_is_log", &[s])?.iter().map(|&flag| flag != 0.0).collect(),
            shift: tensors.take("x_shift", &[s])?,
            scale: tensors.take("x_scale", &[s])?,
            low: tensors.take("x_low", &[s])?,
            high: tensors.take("x_high", &[s])?,
        };
        for i in 0..s {
            let (low, high) = (found.low[i], found.high[i]);
            if low > high || (found.is_log[i] && low <= 0.0) {
                let allowed = "at most x_high, and positive where there is a logarithm";
                return Err(tensors.unfit("x_low", allowed, &format!("{low:e} for {high:e}")));
            }
            if found.scale[i] <= 0.0 {
                return Err(tensors.unfit("x_scale", "positive", &format!("{:e}", found.scale[i])));
            }
        }
        Ok(found)
    }

    /// Standardised statistics where they are, also beyond the training range; a logarithm is taken of a value no
    /// lower than a thousandth of the lowest.
    pub fn apply_unclipped(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len())
            .map(|i| {
                let warped = if self.is_log[i] { x[i].max(1e-3 * self.low[i]).ln() } else { x[i] };
                (warped - self.shift[i]) / self.scale[i]
            })
            .collect()
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
