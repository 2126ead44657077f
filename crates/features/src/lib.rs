//! What a depth camera sees of a granular formation, and the numbers that describe it.
//!
//! [`raster::render`] turns grains into a depth image, [`segment`] turns a depth image, simulated or
//! measured, into the points of the formation, and [`stats::paper16`] turns the points into the
//! 16 statistics. The crate takes slices: it knows no solver and touches no file.
//!
//! | module | what it is |
//! |---|---|
//! | [`camera`] | pinhole camera: intrinsics, pose, projection |
//! | [`depth`] | depth image, down-sampling |
//! | [`raster`] | spheres over a plane to a depth image or a height map, exact to the ray |
//! | [`mod@height_map`] | heights on a regular grid, as a time-of-flight rig delivers them |
//! | [`colour`] | colour image, the range of colours that marks grains, and how it is picked |
//! | [`register`] | the colours of a depth image from a camera beside it |
//! | [`sensor`] | what a depth camera adds: the paper's noise, a fitted sensor, the fit |
//! | [`plane`] | robust plane fit |
//! | [`region`] | rectangles of pixels |
//! | [`segment`] | image to the centred, re-oriented points of the formation |
//! | [`stats`] | the registry of statistics |
//!
//! Lengths are metres. In the world frame the ground is z = 0 and z points up.
//! The equations are derived in `docs/theory/features.md` and `docs/theory/statistics.md`.
//!
//! ```
//! use granulcal_features::{Camera, grain_points, paper16, render_grid};
//! use nalgebra::Vector3;
//!
//! let radius = 0.002;
//! let positions: Vec<_> = (0..40)
//!     .map(|i| Vector3::new(0.01 * f64::from(i % 8), 0.01 * f64::from(i / 8), radius))
//!     .collect();
//! let camera = Camera::overhead(0.29, 0.58, 1920)?;
//! let image = render_grid(&camera, &positions, &[radius; 40], 4)?;
//! let points = grain_points(&camera.downsampled(4)?, &image, 0.5 * radius)?;
//! let statistics = paper16(&points)?;
//! assert!((statistics[0] - 2.0 * radius).abs() < 1e-4); // max_z is the top of a grain
//! # Ok::<(), granulcal_features::FeatureError>(())
//! ```

#![warn(missing_debug_implementations)] // whoever holds one of these in a struct derives it
#![allow(clippy::inline_always)] // what is compiled for wider registers must be inlined to reach them

pub mod camera;
pub mod colour;
pub mod depth;
pub mod error;
pub mod height_map;
mod median;
pub mod plane;
pub mod raster;
pub mod region;
pub mod register;
mod rng;
pub mod segment;
pub mod sensor;
pub mod series;
pub mod stats;

pub use camera::{Camera, Intrinsics};
pub use colour::{ColourImage, HsvRange, Picked, pick_range};
pub use depth::DepthImage;
pub use error::{Cleaned, FeatureError};
pub use height_map::HeightMap;
pub use plane::{Plane, PlaneFit, fit_plane, fit_plane_within};
pub use raster::{ConvexShape, height_map, render, render_convex, render_grid};
pub use region::Region;
pub use register::register_colour;
pub use segment::{
    EdgePixels, Formation, Kind, Levelled, Part, Segmentation, Shape, Threshold, grain_points,
    level_depth, level_height_map, segment_depth, segment_height_map,
};
pub use sensor::{
    DepthSensor, Moments, NoiseField, Observe, SensorNoise, StereoSensor, TimeOfFlightSensor,
};
pub use stats::{
    DIAGNOSTICS, DiagnosticSettings, PAPER16, Prepared, Statistic, Survey, diagnostics, paper16,
};
