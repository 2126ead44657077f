//! A sensor's parameters from frames of a flat surface.
//!
//! Derived in `docs/theory/sensor.md`, equations (6) to (10): the residuals from a fitted plane have
//! covariances, what frames share is the fixed pattern, and the model is the one for which the same
//! covariances are expected after the same treatment. Simulated frames judge it.
//!
//! ```
//! use granulcal_features::sensor::fit::{FitSettings, FlatFrames, fit};
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

mod components;
mod covariance;
mod expected;
mod flat;
mod frames;
mod margins;
mod session;
mod step;

use serde::Serialize;

use super::{DepthSensor, NoiseField, StereoSensor, TimeOfFlightSensor};
use crate::error::{FeatureError, require_in};
use crate::region::Region;
use components::Estimator;
pub use covariance::{Covariances, Split};
pub use frames::FlatFrames;
use session::Session;

/// Share of the variance below which a component of the noise is dropped.
const LEAST_NOISE: f64 = 0.005;
/// Share of the variance below which a component of the fixed pattern is dropped: two frames do not
/// tell it from chance.
const LEAST_PATTERN: f64 = 0.02;
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

/// A fitted sensor and how well its simulated frames resemble the measured ones.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorFit {
    /// The sensor.
    pub sensor: DepthSensor,
    /// Measured and simulated covariances of the frames of the fit.
    pub comparison: Comparison,
    /// Holes at depth edges that decided the margin; 0 where the frames show too few.
    pub edge_holes: usize,
}

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

/// Fits noise, fixed pattern, rounding and holes to frames of a flat surface.
///
/// # Errors
/// `TooFewPoints` when a region has hardly any data, `OutOfRange` for a setting or a region outside of
/// the frames.
pub fn fit(frames: &FlatFrames, settings: &FitSettings) -> Result<SensorFit, FeatureError> {
    let session = Session::new(frames, settings)?;
    let (template, edge_holes) = template(frames, &session);
    let mut measured = session.measured();
    // Rounding errs by a white error of its own, which the sensor's rounding will add again.
    let rounding = session.rounding_variance(&template);
    measured.noise.reduce_variance(rounding);
    let sensor = with_fields(&template, &measured, &session.estimator());
    let comparison = session.compare(&sensor, settings)?;
    Ok(SensorFit { sensor, comparison, edge_holes })
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
    sensor.require_valid()?;
    Session::new(frames, settings)?.compare(sensor, settings)
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

impl FitSettings {
    fn require_valid(&self) -> Result<(), FeatureError> {
        require_in("trend_degree", self.trend_degree as f64, 0.0, MAX_DEGREE as f64)?;
        require_in("max_lag [px]", self.max_lag as f64, 1.0, MAX_LAG as f64)?;
        require_in("max_shift [px]", self.max_shift as f64, 0.0, MAX_SHIFT as f64)?;
        require_in("sessions", self.sessions as f64, 2.0, 1e4)
    }
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
