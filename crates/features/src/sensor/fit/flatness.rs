//! Whether frames show something flat.

use serde::Serialize;

use crate::error::FeatureError;

/// Least share of the pixels with data that lie on the surface, and largest standard deviation from it over the
/// distance (of height maps: over the longer side). A depth camera errs by some 2 % of the distance; a room is no wall.
/// docs/results/reliability.md holds them against measured and rendered frames.
const LEAST_ON_SURFACE: f64 = 0.5;
const LARGEST_DEVIATION: f64 = 0.05;

/// How flat the least flat of the frames is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Flatness {
    /// Pixels with data that lie on one smooth surface, as a share of those with data [-].
    pub on_surface: f64,
    /// Robust standard deviation of those from the surface over the distance, of height maps over the longer side [-].
    pub deviation: f64,
}

impl Flatness {
    /// Of no frame.
    pub(super) const BEST: Self = Self { on_surface: 1.0, deviation: 0.0 };

    /// That of both together.
    pub(super) fn worst(self, other: Self) -> Self {
        Self {
            on_surface: self.on_surface.min(other.on_surface),
            deviation: self.deviation.max(other.deviation),
        }
    }

    /// Refuses frames of what is not flat: their shape would be taken for the sensor's pattern.
    pub(super) fn require(self, scale: &'static str) -> Result<Self, FeatureError> {
        if self.on_surface >= LEAST_ON_SURFACE && self.deviation <= LARGEST_DEVIATION {
            return Ok(self);
        }
        let (on_surface, deviation) = (100.0 * self.on_surface, 100.0 * self.deviation);
        Err(FeatureError::NotFlat { on_surface, deviation, scale })
    }
}
