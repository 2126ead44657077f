//! How a model's frames resemble measured ones.

use serde::Serialize;

use super::covariance::{Covariances, Split};

/// Covariances of measured frames beside those of a model's simulated frames, both after the same
/// trend removal.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// Unit of the standard deviations: "px" of disparity, or "m".
    pub unit: &'static str,
    /// Frames that were compared.
    pub frames: usize,
    /// Pixels of a frame that have a residual, on average.
    pub pixels: usize,
    /// Where each frame was cut, relative to the first `[px]`.
    pub shifts: Vec<(isize, isize)>,
    /// Covariances of the measured frames.
    pub measured: Split,
    /// Mean over the simulated sessions.
    pub model: Split,
    /// Standard deviation from session to session: what chance alone does to `measured`.
    pub spread: Split,
}

impl Comparison {
    /// Standard deviation of a single frame, measured and of the model, in `unit`.
    pub fn sd(&self) -> (f64, f64) {
        let sd = |split: &Split| split.total().variance().max(0.0).sqrt();
        (sd(&self.measured), sd(&self.model))
    }

    /// Largest difference of the correlations of a single frame at lags up to `max_lag`, along the
    /// rows and the columns `[-]`.
    pub fn worst_correlation(&self, max_lag: usize) -> f64 {
        let (measured, model) = (self.measured.total(), self.model.total());
        let own = |covariances: &Covariances| covariances.variance().max(f64::MIN_POSITIVE);
        let (a, b) = (own(&measured), own(&model));
        let along = |x: &[f64], y: &[f64]| {
            let pairs = x.iter().zip(y).take(max_lag + 1);
            pairs.map(|(x, y)| (x / a - y / b).abs()).fold(0.0, f64::max)
        };
        along(&measured.x, &model.x).max(along(&measured.y, &model.y))
    }
}
