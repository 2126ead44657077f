//! A depth camera as it is fitted from flat frames, stereo or time of flight, as numbers. What it delivers of an image is in
//! `observe.rs`.
//!
//! Equations (1) to (5) of `docs/theory/sensor.md`.

use granulcal_numbers::scatter;
use serde::{Deserialize, Serialize};

use super::field::NoiseField;
use crate::error::{FeatureError, require_in};

/// Largest step of the disparity `[px]` that is accepted.
const MAX_STEP: f64 = 16.0;
/// Largest depth unit `[m]` that is accepted.
const MAX_UNIT: f64 = 1.0;
/// Largest margin of a hole `[px]` that is accepted.
const MAX_MARGIN: f64 = 1e3;

/// What a depth camera adds to an image: noise, a fixed pattern, rounding and holes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum DepthSensor {
    /// Errors in px of disparity; depth errors grow with z².
    Stereo(StereoSensor),
    /// Errors in metres, whatever the depth: time-of-flight cameras and height maps.
    TimeOfFlight(TimeOfFlightSensor),
}

/// Two imagers a baseline apart; pixels are those of the left one's depth image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StereoSensor {
    /// Focal length `[px]`; all other pixels are counted in the image that has it.
    pub focal_length: f64,
    /// Distance of the imagers `[m]`.
    pub baseline: f64,
    /// Step of the disparity `[px]`; 0 is continuous, a D400 has 1/32.
    #[serde(default)]
    pub quantisation: f64,
    /// Step of the depth `[m]`; 0 is continuous.
    #[serde(default)]
    pub depth_unit: f64,
    /// Width of a hole at a depth edge beyond the jump of the disparity `[px]`.
    #[serde(default)]
    pub edge_margin: f64,
    /// Columns that the right imager does not see, beyond the disparity `[px]`.
    #[serde(default)]
    pub left_margin: f64,
    /// Incidence from which a surface gives no depth `[deg]`; 90 is never.
    #[serde(default = "default_grazing_deg")]
    pub grazing_deg: f64,
    /// Share of the pixels that fail anywhere `[-]`.
    #[serde(default)]
    pub dropout: f64,
    /// Serial number of the camera: the seed of its fixed pattern.
    #[serde(default)]
    pub pattern_seed: u64,
    /// Error of the disparity that is new in every frame `[px]`.
    #[serde(default)]
    pub noise: NoiseField,
    /// Error of the disparity that is the same in every frame `[px]`.
    #[serde(default)]
    pub fixed_pattern: NoiseField,
}

/// A camera, or a rig that delivers height maps, whose errors do not depend on the depth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeOfFlightSensor {
    /// Width of the ground under one pixel of the sensor `[m/px]`; lengths are counted in it.
    pub resolution: f64,
    /// Step of the depth `[m]`; 0 is continuous.
    #[serde(default)]
    pub depth_unit: f64,
    /// Incidence from which a surface gives no depth `[deg]`; 90 is never.
    #[serde(default = "default_grazing_deg")]
    pub grazing_deg: f64,
    /// Share of the pixels that fail anywhere `[-]`.
    #[serde(default)]
    pub dropout: f64,
    /// Serial number of the camera: the seed of its fixed pattern.
    #[serde(default)]
    pub pattern_seed: u64,
    /// Error of the depth that is new in every frame `[m]`.
    #[serde(default)]
    pub noise: NoiseField,
    /// Error of the depth that is the same in every frame `[m]`.
    #[serde(default)]
    pub fixed_pattern: NoiseField,
}

/// 80 degrees: a D435 sees a board up to 78 degrees (`docs/results/sensor.md`).
pub const GRAZING_DEG: f64 = 80.0;

fn default_grazing_deg() -> f64 {
    GRAZING_DEG
}

impl StereoSensor {
    /// A stereo camera without errors.
    pub fn new(focal_length: f64, baseline: f64) -> Self {
        Self {
            focal_length,
            baseline,
            quantisation: 0.0,
            depth_unit: 0.0,
            edge_margin: 0.0,
            left_margin: 0.0,
            grazing_deg: GRAZING_DEG,
            dropout: 0.0,
            pattern_seed: 0,
            noise: NoiseField::default(),
            fixed_pattern: NoiseField::default(),
        }
    }

    /// Disparity of a depth `[px]`, and depth of a disparity `[m]`: z d = f B.
    pub(crate) fn disparity(&self, depth: f64) -> f64 {
        self.focal_length * self.baseline / depth
    }

    /// The depth `[m]` that a disparity `[px]` with its error is delivered as.
    pub(crate) fn deliver(&self, disparity: f64) -> f64 {
        round_to(self.disparity(round_to(disparity, self.quantisation)), self.depth_unit)
    }
}

impl TimeOfFlightSensor {
    /// A sensor without errors.
    pub fn new(resolution: f64) -> Self {
        Self {
            resolution,
            depth_unit: 0.0,
            grazing_deg: GRAZING_DEG,
            dropout: 0.0,
            pattern_seed: 0,
            noise: NoiseField::default(),
            fixed_pattern: NoiseField::default(),
        }
    }
}

/// The nearest multiple of `step`; of 0 the value itself.
pub(crate) fn round_to(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}

impl DepthSensor {
    /// Error that is new in every frame, px of disparity or metres.
    pub fn noise(&self) -> &NoiseField {
        match self {
            Self::Stereo(sensor) => &sensor.noise,
            Self::TimeOfFlight(sensor) => &sensor.noise,
        }
    }

    /// Error that is the same in every frame, px of disparity or metres.
    pub fn fixed_pattern(&self) -> &NoiseField {
        match self {
            Self::Stereo(sensor) => &sensor.fixed_pattern,
            Self::TimeOfFlight(sensor) => &sensor.fixed_pattern,
        }
    }

    pub(super) fn pattern_seed(&self) -> u64 {
        let serial = match self {
            Self::Stereo(sensor) => sensor.pattern_seed,
            Self::TimeOfFlight(sensor) => sensor.pattern_seed,
        };
        // A pour may have the same number as a camera; their fields must still differ.
        scatter(!serial)
    }

    pub(super) fn grazing_deg(&self) -> f64 {
        match self {
            Self::Stereo(sensor) => sensor.grazing_deg,
            Self::TimeOfFlight(sensor) => sensor.grazing_deg,
        }
    }

    /// Refuses numbers that no sensor has.
    ///
    /// # Errors
    /// `OutOfRange` names the number.
    pub fn require_valid(&self) -> Result<(), FeatureError> {
        let (unit, dropout) = match self {
            Self::Stereo(sensor) => {
                require_in("focal_length [px]", sensor.focal_length, 1e-3, 1e9)?;
                require_in("baseline [m]", sensor.baseline, 1e-6, 1e3)?;
                require_in("quantisation [px]", sensor.quantisation, 0.0, MAX_STEP)?;
                require_in("edge_margin [px]", sensor.edge_margin, 0.0, MAX_MARGIN)?;
                require_in("left_margin [px]", sensor.left_margin, 0.0, MAX_MARGIN)?;
                (sensor.depth_unit, sensor.dropout)
            }
            Self::TimeOfFlight(sensor) => {
                require_in("resolution [m/px]", sensor.resolution, 1e-9, 1e3)?;
                (sensor.depth_unit, sensor.dropout)
            }
        };
        require_in("depth_unit [m]", unit, 0.0, MAX_UNIT)?;
        require_in("dropout [-]", dropout, 0.0, 1.0)?;
        require_in("grazing_deg [deg]", self.grazing_deg(), 0.0, 90.0)?;
        self.noise().require_valid()?;
        self.fixed_pattern().require_valid()
    }
}

#[cfg(test)]
mod tests;
