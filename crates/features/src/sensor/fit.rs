//! A sensor's parameters from frames of a flat surface.
//!
//! Derived in `docs/theory/sensor.md`, equations (6) to (10): the residuals from a fitted plane have
//! covariances, what frames share is the fixed pattern, and the model is the one for which the same
//! covariances are expected after the same treatment. Simulated frames judge it.
//!
//! ```
//! use granulcal_features::sensor::fit::{FitSettings, FlatFrames, fit};
//! use granulcal_features::sensor::{Moments, Observe};
//! use granulcal_features::{DepthSensor, HeightMap, NoiseField, TimeOfFlightSensor};
//!
//! let noise = NoiseField { white: 2e-4, ..NoiseField::default() };
//! let sensor = DepthSensor::TimeOfFlight(TimeOfFlightSensor {
//!     noise,
//!     ..TimeOfFlightSensor::new(0.003)
//! });
//! let bed = HeightMap::new(40, 40, 0.003, 0.003, vec![0.0; 1600])?;
//! let maps = (0..3).map(|seed| sensor.observe_height_map(&bed, seed));
//! let frames = FlatFrames::from_height_maps(&maps.collect::<Result<Vec<_>, _>>()?)?;
//! let found = fit(&frames, &FitSettings { max_lag: 8, ..FitSettings::default() })?;
//! assert!((found.sensor.noise().sd() / 2e-4 - 1.0).abs() < 0.1);
//! # Ok::<(), granulcal_features::FeatureError>(())
//! ```

mod bump;
mod comparison;
mod components;
mod covariance;
mod expected;
mod flat;
mod flatness;
mod frames;
mod margins;
mod session;
mod settings;
mod step;

use super::{DepthSensor, NoiseField, StereoSensor, TimeOfFlightSensor};
use crate::error::FeatureError;
pub use comparison::Comparison;
use components::Estimator;
pub use covariance::{Covariances, Split};
pub use flatness::Flatness;
pub use frames::FlatFrames;
use session::Session;
pub use settings::FitSettings;

/// Share of the variance below which a component of the noise is dropped.
const LEAST_NOISE: f64 = 0.005;
/// Share of the variance below which a component of the fixed pattern is dropped: two frames do not
/// tell it from chance.
const LEAST_PATTERN: f64 = 0.02;
/// A fitted sensor and how well its simulated frames resemble the measured ones.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorFit {
    /// The sensor.
    pub sensor: DepthSensor,
    /// Measured and simulated covariances of the frames of the fit.
    pub comparison: Comparison,
    /// How flat the least flat of the frames is.
    pub flatness: Flatness,
    /// Holes at depth edges that decided the margin; 0 where the frames show too few.
    pub edge_holes: usize,
}

/// Fits noise, fixed pattern, rounding and holes to frames of a flat surface.
///
/// # Errors
/// `NotFlat` and `Bump` for frames of something else, `TooFewPoints` when a region has hardly any data, `OutOfRange`
/// for a setting or a region outside of the frames.
pub fn fit(frames: &FlatFrames, settings: &FitSettings) -> Result<SensorFit, FeatureError> {
    let session = Session::new(frames, settings)?;
    let (template, edge_holes) = template(frames, &session);
    let mut measured = session.measured();
    // Rounding errs by a white error of its own, which the sensor's rounding will add again.
    let rounding = session.rounding_variance(&template);
    measured.noise.reduce_variance(rounding);
    let sensor = with_fields(&template, &measured, &session.estimator());
    let comparison = session.compare(&sensor, settings)?;
    Ok(SensorFit { sensor, comparison, flatness: session.flatness(), edge_holes })
}

/// How a sensor's simulated frames compare with measured ones, for instance with frames that the fit
/// did not see.
///
/// # Errors
/// As [`fit`], and `OutOfRange` for a sensor that means nothing.
pub fn compare(
    sensor: &DepthSensor,
    frames: &FlatFrames,
    settings: &FitSettings,
) -> Result<Comparison, FeatureError> {
    sensor.check("sensor")?;
    Session::new(frames, settings)?.compare(sensor, settings)
}

/// The sensor without fields: what is known of the optics, the rounding and the holes.
fn template(frames: &FlatFrames, session: &Session) -> (DepthSensor, usize) {
    let dropout = session.dropout();
    match frames.optics {
        frames::Optics::Stereo { focal_length, baseline, depth_unit } => {
            let margins = margins::of_holes(frames);
            let sensor = StereoSensor {
                quantisation: step::of_disparity(frames, depth_unit, focal_length * baseline),
                depth_unit,
                dropout,
                edge_margin: margins.edge,
                left_margin: margins.left,
                ..StereoSensor::new(focal_length, baseline)
            };
            (DepthSensor::Stereo(sensor), margins.edge_holes)
        }
        frames::Optics::TimeOfFlight { resolution, depth_unit, .. } => {
            let sensor =
                TimeOfFlightSensor { depth_unit, dropout, ..TimeOfFlightSensor::new(resolution) };
            (DepthSensor::TimeOfFlight(sensor), 0)
        }
    }
}

/// The sensor with the fields whose estimates are these covariances.
fn with_fields(template: &DepthSensor, target: &Split, estimator: &Estimator) -> DepthSensor {
    let variance = target.total().variance().max(0.0);
    let found = |covariances: &Covariances, pattern: bool, least: f64| -> NoiseField {
        components::decompose(covariances, estimator, pattern, least * variance)
    };
    let noise = found(&target.noise, false, LEAST_NOISE);
    let fixed_pattern = found(&target.fixed_pattern, true, LEAST_PATTERN);
    match *template {
        DepthSensor::Stereo(sensor) => {
            DepthSensor::Stereo(StereoSensor { noise, fixed_pattern, ..sensor })
        }
        DepthSensor::TimeOfFlight(sensor) => {
            DepthSensor::TimeOfFlight(TimeOfFlightSensor { noise, fixed_pattern, ..sensor })
        }
    }
}

#[cfg(test)]
mod tests;
