//! Whether frames show something flat.

use serde::Serialize;

use crate::error::FeatureError;

/// Least share of the pixels with data that lie on the surface, and the same where bumps cannot be told from the noise;
/// largest standard deviation from it over the distance (of height maps: over the longer side). Of Gaussian errors
/// 0.006 % are off it, of those of measured cameras 1 %. A depth camera errs by some 2 % of the distance; a room is no
/// wall. docs/results/reliability.md holds them against measured and rendered frames.
const LEAST_ON_SURFACE: f64 = 0.9;
const LEAST_WITHOUT_BUMP: f64 = 0.97;
const LARGEST_DEVIATION: f64 = 0.05;

/// How flat the least flat of the frames is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Flatness {
    /// Pixels with data that lie on one smooth surface, as a share of those with data [-].
    pub on_surface: f64,
    /// Robust standard deviation of those from the surface over the distance, of height maps over the longer side [-].
    pub deviation: f64,
    /// Largest distance of a part of a frame from the surface of the rest, over the largest that chance gives [-]; none
    /// where too few parts are independent of each other.
    pub bump: Option<f64>,
}

impl Flatness {
    /// Of no frame.
    pub(super) const BEST: Self = Self { on_surface: 1.0, deviation: 0.0, bump: None };

    /// That of both together.
    pub(super) fn worst(self, other: Self) -> Self {
        Self {
            on_surface: self.on_surface.min(other.on_surface),
            deviation: self.deviation.max(other.deviation),
            bump: self.bump.into_iter().chain(other.bump).reduce(f64::max),
        }
    }

    /// The least share of the pixels with data that must lie on the surface [-].
    pub fn least_on_surface(&self) -> f64 {
        if self.bump.is_some() { LEAST_ON_SURFACE } else { LEAST_WITHOUT_BUMP }
    }

    /// Whether what lies on the surface lies as near to it as a camera errs.
    pub(super) fn is_near(&self) -> bool {
        self.deviation <= LARGEST_DEVIATION
    }

    /// Refuses frames of what is not flat: their shape would be taken for the sensor's pattern.
    pub(super) fn require(self, scale: &'static str) -> Result<Self, FeatureError> {
        let least = self.least_on_surface();
        if self.on_surface >= least && self.is_near() {
            return Ok(self);
        }
        let [on_surface, least, deviation] =
            [self.on_surface, least, self.deviation].map(|share| 100.0 * share);
        Err(FeatureError::NotFlat { on_surface, least, deviation, scale })
    }
}
