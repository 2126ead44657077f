//! What all statistics start from, computed once.

use std::cell::OnceCell;

use nalgebra::{Vector2, Vector3};

use super::MIN_POINTS;
use super::chi::ChiFit;
use crate::error::{FeatureError, require_finite, require_in};

/// Largest coordinate `[m]`: its fourth power is far from overflow.
const MAX_COORDINATE: f64 = 1e6;

/// Relative range below which values count as equal. The rounding of coordinates and of r leaves a
/// few 1e-16 of the value; nothing that was measured is this exact.
const EQUAL: f64 = 1e-12;

/// Points in the form that the statistics need.
#[derive(Debug, Clone)]
pub struct Prepared {
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    r: Vec<f64>,
    /// Three statistics read one fit.
    chi: OnceCell<ChiFit>,
}

impl Prepared {
    /// Counts x and y from the centroid and computes r.
    ///
    /// # Errors
    /// As [`super::paper16`].
    pub fn new(points: &[Vector3<f64>]) -> Result<Self, FeatureError> {
        if points.len() < MIN_POINTS {
            let got = points.len();
            return Err(FeatureError::TooFewPoints { what: "statistics", got, min: MIN_POINTS });
        }
        require_finite("points", points.iter().flat_map(|p| [p.x, p.y, p.z]))?;
        for &coordinate in points.iter().flatten() {
            require_in("point [m]", coordinate, -MAX_COORDINATE, MAX_COORDINATE)?;
        }
        let centroid = points.iter().map(Vector3::xy).sum::<Vector2<f64>>() / points.len() as f64;
        let x: Vec<_> = points.iter().map(|p| p.x - centroid.x).collect();
        let y: Vec<_> = points.iter().map(|p| p.y - centroid.y).collect();
        let z = points.iter().map(|p| p.z).collect();
        // The coordinates are bounded, so the square root is as safe as `hypot` and much faster.
        let r = x.iter().zip(&y).map(|(x, y)| (x * x + y * y).sqrt()).collect();
        Ok(Self { x, y, z, r, chi: OnceCell::new() })
    }

    /// x from the centroid `[m]`.
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// y from the centroid `[m]`.
    pub fn y(&self) -> &[f64] {
        &self.y
    }

    /// Height above the ground `[m]`.
    pub fn z(&self) -> &[f64] {
        &self.z
    }

    /// Horizontal distance from the centroid `[m]`.
    pub fn r(&self) -> &[f64] {
        &self.r
    }

    /// The chi distribution fitted to r.
    pub fn chi(&self) -> &ChiFit {
        self.chi.get_or_init(|| ChiFit::new(&self.r))
    }
}

/// Arithmetic mean; 0 of nothing.
pub(super) fn mean(values: &[f64]) -> f64 {
    if values.is_empty() { 0.0 } else { values.iter().sum::<f64>() / values.len() as f64 }
}

/// Smallest and largest value.
pub(super) fn extremes(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}

/// Whether all values are equal up to rounding.
pub(super) fn is_constant(values: &[f64]) -> bool {
    let (low, high) = extremes(values);
    // Also true of no values, where high < low.
    high - low <= EQUAL * low.abs().max(high.abs()) || high <= low
}
