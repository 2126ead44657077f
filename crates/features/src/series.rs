//! What is seen of grains while they move: one noun a file. A frame is centres and radii; what a scene
//! observes, and when, is said elsewhere. docs/theory/statistics.md, "Observations over time".

pub mod front;
pub mod outline;
pub mod percentile;
pub mod sheet;
pub mod silhouette;

pub use front::front_radius;
pub use outline::outline_radius;
pub use percentile::mass_percentiles;
pub use sheet::sheet_radius;
pub use silhouette::Silhouette;
