//! Statistics to mean 0 and spread 1.

use crate::ModelError;
use crate::tensors::Tensors;

/// Below this share of its own size a spread is round-off, not signal `[-]`.
const CONSTANT_SPREAD: f64 = 1e-9;

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

    /// What never changed in training but for round-off, as it was there if round-off is all that it is off by.
    fn as_in_training(&self, i: usize, x: f64) -> f64 {
        let (low, high) = (self.low[i], self.high[i]);
        let middle = 0.5 * (low + high);
        let is_constant = high - low <= CONSTANT_SPREAD * low.abs().max(high.abs());
        let is_still = is_constant && (x - middle).abs() <= CONSTANT_SPREAD * middle.abs();
        if is_still { middle } else { x }
    }

    /// Standardised statistics where they are, also beyond the training range; a logarithm is taken of a value no
    /// lower than a thousandth of the lowest.
    pub fn apply_unclipped(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len())
            .map(|i| {
                let x = self.as_in_training(i, x[i]);
                let warped = if self.is_log[i] { x.max(1e-3 * self.low[i]).ln() } else { x };
                (warped - self.shift[i]) / self.scale[i]
            })
            .collect()
    }

    /// Standardised statistics; values beyond the training range are moved to it.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        (0..x.len())
            .map(|i| {
                let inside = self.as_in_training(i, x[i]).clamp(self.low[i], self.high[i]);
                let warped = if self.is_log[i] { inside.ln() } else { inside };
                (warped - self.shift[i]) / self.scale[i]
            })
            .collect()
    }
}
