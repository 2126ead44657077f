//! One Gaussian of a mixture.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};

/// One component: its precision is `F F^T`.
#[derive(Clone, Debug)]
pub struct Component {
    /// Log weight.
    pub log_weight: f64,
    /// Its centre.
    pub mean: DVector<f64>,
    /// F, lower triangular with a positive diagonal.
    pub factor: DMatrix<f64>,
}

impl Component {
    /// What of the log density does not depend on where.
    pub fn constant(&self) -> f64 {
        let log_det: f64 = self.factor.diagonal().iter().map(|d| d.ln()).sum();
        self.log_weight + log_det - 0.5 * self.mean.len() as f64 * TAU.ln()
    }
}
