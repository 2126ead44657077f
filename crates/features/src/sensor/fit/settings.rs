//! How a sensor is fitted.

use crate::error::{FeatureError, require_in};
use crate::region::Region;

/// Highest degree of the trend.
const MAX_DEGREE: usize = 4;
/// Longest lag `[px]`.
const MAX_LAG: usize = 200;
/// Longest shift `[px]`.
const MAX_SHIFT: usize = 64;

/// How a sensor is fitted.
#[derive(Debug, Clone, PartialEq)]
pub struct FitSettings {
    /// Where the frames show a flat surface; none is the whole frame.
    pub regions: Vec<Region>,
    /// Degree of the polynomial that is removed `[-]`; 1 is a plane.
    pub trend_degree: usize,
    /// Longest lag of the covariances `[px]`.
    pub max_lag: usize,
    /// Farthest that the frames may have been cut from different places of the sensor `[px]`.
    pub max_shift: usize,
    /// Sessions that are simulated to judge the fit.
    pub sessions: usize,
    /// Seed of the simulated sessions.
    pub seed: u64,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            regions: Vec::new(),
            trend_degree: 2,
            max_lag: 24,
            max_shift: 0,
            sessions: 24,
            seed: 0,
        }
    }
}

impl FitSettings {
    pub(super) fn require_valid(&self) -> Result<(), FeatureError> {
        require_in("trend_degree", self.trend_degree as f64, 0.0, MAX_DEGREE as f64)?;
        require_in("max_lag [px]", self.max_lag as f64, 1.0, MAX_LAG as f64)?;
        require_in("max_shift [px]", self.max_shift as f64, 0.0, MAX_SHIFT as f64)?;
        require_in("sessions", self.sessions as f64, 2.0, 1e4)
    }
}
