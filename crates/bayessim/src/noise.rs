//! Noise of several statistics: one correlation, Student tails.

use std::f64::consts::PI;

use crate::matrix::{Matrix, dot};

/// Multivariate t.
#[derive(Clone, Debug)]
pub struct Noise {
    /// Inverse of the lower triangular root of the scatter, row-major.
    whiten: Matrix,
    degrees: f64,
    constant: f64,
}

impl Noise {
    /// Of the lower triangular root of the scatter.
    pub fn new(root: &Matrix, degrees: f64) -> Self {
        let size = root.columns;
        let mut whiten = Matrix { data: vec![0.0; size * size], columns: size };
        for column in 0..size {
            let mut unit = vec![0.0; size];
            unit[column] = 1.0;
            let solved = crate::matrix::solve_lower(root, &unit);
            for (row, value) in solved.into_iter().enumerate() {
                whiten.data[row * size + column] = value;
            }
        }
        let s = size as f64;
        let log_root: f64 = (0..size).map(|i| root.row(i)[i].ln()).sum();
        let constant = libm::lgamma(0.5 * (degrees + s))
            - libm::lgamma(0.5 * degrees)
            - 0.5 * s * (degrees * PI).ln()
            - log_root;
        Self { whiten, degrees, constant }
    }

    /// Deviations already divided by their scales, in independent units.
    pub fn whitened(&self, scaled: &[f64]) -> Vec<f64> {
        let white = |i: usize| dot(&self.whiten.row(i)[..=i], &scaled[..=i]);
        (0..scaled.len()).map(white).collect()
    }

    /// Log density of deviations already divided by their scales, less the logarithms of the scales.
    pub fn log_density(&self, scaled: &[f64], log_scales: f64) -> f64 {
        let size = scaled.len();
        let mut square = 0.0;
        for i in 0..size {
            let white = dot(&self.whiten.row(i)[..=i], &scaled[..=i]);
            square += white * white;
        }
        let power = 0.5 * (self.degrees + size as f64);
        self.constant - log_scales - power * (square / self.degrees).ln_1p()
    }
}
