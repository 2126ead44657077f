//! What the second family of statistics has to know besides the points.

use nalgebra::Vector2;

use crate::error::{FeatureError, require_in};
use crate::stats::prepared::MAX_COORDINATE;

/// What the second family has to know besides the points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiagnosticSettings {
    /// Where the axis of the pour meets the ground, in the frame of the points `[m]`; the centroid of
    /// the points if `None`, from which no mode of order 1 can be seen for certain.
    pub pour_axis: Option<Vector2<f64>>,
    /// Diameter of a grain `[m]`: larger bodies are more than one.
    pub grain_diameter: f64,
    /// Distance of neighbouring points on the ground `[m]`: the side of a pixel there.
    pub spacing: f64,
}

/// Smallest and largest length of [`DiagnosticSettings`] `[m]`.
const LENGTHS: (f64, f64) = (1e-9, 1e3);

impl DiagnosticSettings {
    /// Refuses lengths that no grain and no pixel has, and an axis that is nowhere.
    ///
    /// # Errors
    /// `OutOfRange`.
    pub fn require_valid(&self) -> Result<(), FeatureError> {
        let (min, max) = LENGTHS;
        require_in("grain diameter [m]", self.grain_diameter, min, max)?;
        require_in("spacing [m]", self.spacing, min, max)?;
        let bound = MAX_COORDINATE;
        let axis = self.pour_axis.unwrap_or_default();
        axis.iter().try_for_each(|&c| require_in("pour axis [m]", c, -bound, bound))
    }
}
