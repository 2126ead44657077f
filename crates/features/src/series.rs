//! What is seen of grains while they move: one noun a file. A frame is centres and radii; what a scene
//! observes, and when, is said elsewhere. docs/theory/statistics.md, "Observations over time".

pub mod front;
pub mod outline;
pub mod percentile;
pub mod sheet;
pub mod silhouette;

use nalgebra::{Vector2, Vector3};

use crate::error::{FeatureError, require_finite, require_in, require_length};
pub use front::front_radius;
pub use outline::outline_radius;
pub use percentile::mass_percentiles;
pub use sheet::sheet_radius;
pub use silhouette::Silhouette;

/// Refuses a frame that has not one radius above 0 for each centre, or an axis that is nowhere.
fn require_frame(
    positions: &[Vector3<f64>],
    radii: &[f64],
    axis: Vector2<f64>,
) -> Result<(), FeatureError> {
    require_length("radii", radii.len(), positions.len())?;
    require_finite("axis [m]", axis.iter().copied())?;
    radii.iter().try_for_each(|&radius| require_in("radius [m]", radius, f64::MIN_POSITIVE, 1e6))
}
