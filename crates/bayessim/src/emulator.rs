//! Means and scales of the leading signal axes, linear in random features of the coordinates.

use crate::ModelError;
use crate::matrix::{Matrix, dot};
use crate::tensors::Tensors;

/// Prior standard deviation of constant and slopes over that of the random features' sum.
const POLYNOMIAL: f64 = 3.0;

/// Polynomial and random Fourier features.
#[derive(Clone, Debug)]
struct Basis {
    centre: Vec<f64>,
    scale: Vec<f64>,
    frequencies: Matrix,
    is_quadratic: bool,
}

impl Basis {
    fn size(&self) -> usize {
        let p = self.centre.len();
        let quadratic = if self.is_quadratic { p * (p + 1) / 2 } else { 0 };
        1 + p + quadratic + 2 * self.frequencies.rows()
    }

    fn fill(&self, u: &[f64], features: &mut Vec<f64>) {
        let p = u.len();
        let v: Vec<_> = (0..p).map(|i| (u[i] - self.centre[i]) / self.scale[i]).collect();
        features.clear();
        features.push(POLYNOMIAL);
        features.extend(v.iter().map(|v| POLYNOMIAL * v));
        if self.is_quadratic {
            for i in 0..p {
                features.extend(v[i..].iter().map(|other| POLYNOMIAL * v[i] * other));
            }
        }
        let count = self.frequencies.rows();
        let size = (count as f64).powf(-0.5);
        let cosines = features.len();
        features.resize(cosines + 2 * count, 0.0);
        for k in 0..count {
            let (sine, cosine) = dot(self.frequencies.row(k), &v).sin_cos();
            features[cosines + k] = size * cosine;
            features[cosines + count + k] = size * sine;
        }
    }
}

/// What is expected at one point, axis by axis.
#[derive(Clone, Debug)]
pub struct Prediction {
    pub means: Vec<f64>,
    /// Variance of what the emulator leaves of one pour.
    pub noise: Vec<f64>,
    /// Variance of the means themselves.
    pub unknown: Vec<f64>,
}

/// Emulator of r axes.
#[derive(Clone, Debug)]
pub struct Emulator {
    basis: Basis,
    coefficients: Matrix,
    scale_basis: Basis,
    scale_coefficients: Matrix,
    unknown_coefficients: Matrix,
    shift: Vec<f64>,
    spread: Vec<f64>,
}

impl Emulator {
    /// The first `axes` of `s` axes over `p` coordinates.
    pub fn read(
        tensors: &Tensors,
        p: usize,
        s: usize,
        features: usize,
        axes: usize,
    ) -> Result<Self, ModelError> {
        let centre = tensors.take("emulator_centre", &[p])?;
        let scale = tensors.take("emulator_scale", &[p])?;
        let basis = Basis {
            centre: centre.clone(),
            scale: scale.clone(),
            frequencies: tensors.matrix("emulator_frequencies", features, p)?,
            is_quadratic: false,
        };
        let frequencies = tensors.rows("emulator_scale_frequencies", None, Some(p))?;
        let scale_basis = Basis { centre, scale, frequencies, is_quadratic: true };
        let first = |name: &str, columns: usize| -> Result<Matrix, ModelError> {
            Ok(tensors.matrix(name, s, columns)?.first(axes))
        };
        let leading = |name: &str| -> Result<Vec<f64>, ModelError> {
            let mut all = tensors.take(name, &[s])?;
            all.truncate(axes);
            Ok(all)
        };
        Ok(Self {
            coefficients: first("emulator_coefficients", basis.size())?,
            scale_coefficients: first("emulator_scale_coefficients", scale_basis.size())?,
            unknown_coefficients: first("emulator_unknown_coefficients", scale_basis.size())?,
            shift: leading("emulator_y_shift")?,
            spread: leading("emulator_y_spread")?,
            basis,
            scale_basis,
        })
    }

    pub fn axis_count(&self) -> usize {
        self.shift.len()
    }

    pub fn predict(&self, u: &[f64]) -> Prediction {
        let mut features = Vec::with_capacity(self.basis.size());
        self.basis.fill(u, &mut features);
        let axes = 0..self.shift.len();
        let mean =
            |j: usize| self.shift[j] + self.spread[j] * dot(self.coefficients.row(j), &features);
        let means = axes.clone().map(mean).collect();
        self.scale_basis.fill(u, &mut features);
        let variance = |coefficients: &Matrix, j: usize| {
            (self.spread[j] * dot(coefficients.row(j), &features).exp()).powi(2)
        };
        Prediction {
            means,
            noise: axes.clone().map(|j| variance(&self.scale_coefficients, j)).collect(),
            unknown: axes.map(|j| variance(&self.unknown_coefficients, j)).collect(),
        }
    }
}
