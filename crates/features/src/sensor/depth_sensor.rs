//! A depth camera as it is fitted from flat frames: stereo, or time of flight.
//!
//! Equations (1) to (5) of `docs/theory/sensor.md`.

use serde::{Deserialize, Serialize};

use super::field::{NoiseField, SensorGrid, scatter};
use super::holes;
use crate::camera::Camera;
use crate::depth::{DepthImage, is_valid};
use crate::error::{FeatureError, require_in};
use crate::height_map::HeightMap;
use crate::rng::Stream;

/// Largest step of the disparity `[px]` that is accepted.
const MAX_STEP: f64 = 16.0;
/// Largest depth unit `[m]` that is accepted.
const MAX_UNIT: f64 = 1.0;
/// Largest margin of a hole `[px]` that is accepted.
const MAX_MARGIN: f64 = 1e3;
/// Separates the stream of the drop-out from those of the fields.
const DROPOUT_STREAM: u64 = 0x0d0d;

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

    /// What the camera delivers of a noise-free depth image; the same seed gives the same noise.
    ///
    /// `image` is what `camera` took, at its own resolution or down-sampled (pass
    /// [`Camera::downsampled`] then): its pixels get the errors of the sensor's pixels that they show.
    ///
    /// # Errors
    /// `OutOfRange` for a number of the sensor that means nothing, `SizeMismatch` for another camera,
    /// and for a time-of-flight sensor `OutOfRange` when the camera is not above the ground.
    pub fn observe(
        &self,
        camera: &Camera,
        image: &DepthImage,
        seed: u64,
    ) -> Result<DepthImage, FeatureError> {
        self.require_valid()?;
        camera.require_valid()?;
        image.require_valid()?;
        camera.require_size(image.width, image.height)?;
        let scale = match self {
            Self::Stereo(sensor) => sensor.focal_length / camera.intrinsics.fx,
            Self::TimeOfFlight(sensor) => {
                let height = camera.centre_in_world().z;
                require_in("height of the camera [m]", height, f64::MIN_POSITIVE, 1e3)?;
                height / camera.intrinsics.fx / sensor.resolution
            }
        };
        let grid = SensorGrid::under(image.width, image.height, scale)?;
        let errors = self.errors(&grid, seed);
        let mut seen: Vec<bool> = image.depth.iter().map(|&d| is_valid(d)).collect();
        holes::clear_grazing(&mut seen, image, camera, self.grazing_deg());
        if let Self::Stereo(sensor) = self {
            holes::clear_occluded(&mut seen, image, sensor, scale);
        }
        self.drop_out(&mut seen, &grid, seed);
        let depth = image.depth.iter().zip(errors).zip(seen).map(|((&depth, error), seen)| {
            if !seen {
                return 0.0;
            }
            let got = match self {
                Self::Stereo(sensor) => sensor.deliver(sensor.disparity(f64::from(depth)) + error),
                Self::TimeOfFlight(sensor) => round_to(f64::from(depth) + error, sensor.depth_unit),
            } as f32;
            if is_valid(got) { got } else { 0.0 }
        });
        DepthImage::new(image.width, image.height, depth.collect())
    }

    /// What a rig with this sensor delivers of a noise-free height map.
    ///
    /// # Errors
    /// As [`DepthSensor::observe`]; `NeedsPinhole` for a stereo sensor, which has no depth to start from.
    pub fn observe_height_map(
        &self,
        map: &HeightMap,
        seed: u64,
    ) -> Result<HeightMap, FeatureError> {
        self.require_valid()?;
        map.require_valid()?;
        let Self::TimeOfFlight(sensor) = self else {
            return Err(FeatureError::NeedsPinhole);
        };
        let grid = SensorGrid::under(map.width, map.height, map.resolution_x / sensor.resolution)?;
        let mut seen: Vec<bool> = map.z.iter().map(|z| z.is_finite()).collect();
        holes::clear_grazing_heights(&mut seen, map, sensor.grazing_deg);
        self.drop_out(&mut seen, &grid, seed);
        let z = map.z.iter().zip(self.errors(&grid, seed)).zip(seen).map(|((z, error), seen)| {
            if seen { round_to(z + error, sensor.depth_unit) } else { f64::NAN }
        });
        Ok(HeightMap { z: z.collect(), ..*map })
    }

    /// The sum of noise and fixed pattern on the grid.
    fn errors(&self, grid: &SensorGrid, seed: u64) -> Vec<f64> {
        let mut errors = self.noise().sample(grid, seed);
        if !self.fixed_pattern().is_none() {
            let pattern = self.fixed_pattern().sample(grid, self.pattern_seed());
            errors.iter_mut().zip(pattern).for_each(|(error, value)| *error += value);
        }
        errors
    }

    /// Clears the pixels that fail by chance; the same pixels of the sensor whatever the image.
    fn drop_out(&self, seen: &mut [bool], grid: &SensorGrid, seed: u64) {
        let share = match self {
            Self::Stereo(sensor) => sensor.dropout,
            Self::TimeOfFlight(sensor) => sensor.dropout,
        };
        if share == 0.0 {
            return;
        }
        let width = grid.columns.len();
        for (row, &v) in seen.chunks_exact_mut(width).zip(&grid.rows) {
            for (pixel, &u) in row.iter_mut().zip(&grid.columns) {
                let place = scatter((v as u64) << 32 | u as u64);
                let mut stream = Stream::new(scatter(seed ^ DROPOUT_STREAM) ^ place);
                *pixel &= stream.uniform() >= share;
            }
        }
    }

    fn pattern_seed(&self) -> u64 {
        let serial = match self {
            Self::Stereo(sensor) => sensor.pattern_seed,
            Self::TimeOfFlight(sensor) => sensor.pattern_seed,
        };
        // A pour may have the same number as a camera; their fields must still differ.
        scatter(!serial)
    }

    fn grazing_deg(&self) -> f64 {
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
