//! What a depth camera delivers of a noise-free image.
//!
//! Equations (1) to (5) of `docs/theory/sensor.md`.

use granulcal_numbers::scatter;
use granulcal_scene::{DepthSensor, round_to};

use super::field::{SensorGrid, sample};
use super::holes;
use crate::camera::Camera;
use crate::depth::{DepthImage, is_valid};
use crate::error::{FeatureError, require_in};
use crate::height_map::HeightMap;
use crate::rng::Stream;

/// Separates the stream of the drop-out from those of the fields.
const DROPOUT_STREAM: u64 = 0x0d0d;

/// What a sensor delivers.
pub trait Observe {
    /// What the camera delivers of a noise-free depth image; the same seed gives the same noise.
    ///
    /// `image` is what `camera` took, at its own resolution or down-sampled (pass
    /// [`Camera::downsampled`] then): its pixels get the errors of the sensor's pixels that they show.
    ///
    /// # Errors
    /// `OutOfRange` for a number of the sensor that means nothing, `SizeMismatch` for another camera,
    /// and for a time-of-flight sensor `OutOfRange` when the camera is not above the ground.
    fn observe(
        &self,
        camera: &Camera,
        image: &DepthImage,
        seed: u64,
    ) -> Result<DepthImage, FeatureError>;

    /// What a rig with this sensor delivers of a noise-free height map.
    ///
    /// # Errors
    /// As [`Observe::observe`]; `NeedsPinhole` for a stereo sensor, which has no depth to start from.
    fn observe_height_map(&self, map: &HeightMap, seed: u64) -> Result<HeightMap, FeatureError>;
}

impl Observe for DepthSensor {
    fn observe(
        &self,
        camera: &Camera,
        image: &DepthImage,
        seed: u64,
    ) -> Result<DepthImage, FeatureError> {
        self.check("sensor")?;
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
        let errors = errors(self, &grid, seed);
        let mut seen: Vec<bool> = image.depth.iter().map(|&d| is_valid(d)).collect();
        holes::clear_grazing(&mut seen, image, camera, self.grazing_deg());
        if let Self::Stereo(sensor) = self {
            holes::clear_occluded(&mut seen, image, sensor, scale);
        }
        drop_out(self, &mut seen, &grid, seed);
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

    fn observe_height_map(&self, map: &HeightMap, seed: u64) -> Result<HeightMap, FeatureError> {
        self.check("sensor")?;
        map.require_valid()?;
        let Self::TimeOfFlight(sensor) = self else {
            return Err(FeatureError::NeedsPinhole);
        };
        let grid = SensorGrid::under(map.width, map.height, map.resolution_x / sensor.resolution)?;
        let mut seen: Vec<bool> = map.z.iter().map(|z| z.is_finite()).collect();
        holes::clear_grazing_heights(&mut seen, map, sensor.grazing_deg);
        drop_out(self, &mut seen, &grid, seed);
        let z = map.z.iter().zip(errors(self, &grid, seed)).zip(seen).map(|((z, error), seen)| {
            if seen { round_to(z + error, sensor.depth_unit) } else { f64::NAN }
        });
        Ok(HeightMap { z: z.collect(), ..*map })
    }
}

/// The sum of noise and fixed pattern on the grid.
fn errors(sensor: &DepthSensor, grid: &SensorGrid, seed: u64) -> Vec<f64> {
    let mut errors = sample(sensor.noise(), grid, seed);
    if !sensor.fixed_pattern().is_none() {
        // A pour may have the same number as a camera; their fields must still differ.
        let pattern = sample(sensor.fixed_pattern(), grid, scatter(!sensor.pattern_seed()));
        errors.iter_mut().zip(pattern).for_each(|(error, value)| *error += value);
    }
    errors
}

/// Clears the pixels that fail by chance; the same pixels of the sensor whatever the image.
fn drop_out(sensor: &DepthSensor, seen: &mut [bool], grid: &SensorGrid, seed: u64) {
    let share = match sensor {
        DepthSensor::Stereo(sensor) => sensor.dropout,
        DepthSensor::TimeOfFlight(sensor) => sensor.dropout,
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

#[cfg(test)]
mod tests;
