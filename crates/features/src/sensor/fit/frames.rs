//! Frames of a flat surface, in the quantity in which a plane is affine and errors add.

use crate::camera::Camera;
use crate::depth::{DepthImage, is_valid};
use crate::error::{FeatureError, require_in};
use crate::height_map::HeightMap;
use crate::median::median;
use crate::region::Region;

/// Share of the distance that no camera resolves.
const LEAST_STEP: f64 = 1e-6;
/// Widest baseline of a stereo camera `[m]`: what is wider was meant in millimetres.
const WIDEST_BASELINE: f64 = 1.0;

/// What is known of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Optics {
    /// Values are disparities `[px]`.
    Stereo { focal_length: f64, baseline: f64, depth_unit: f64 },
    /// Values are heights `[m]`, or, seen through a lens, inverse depths `[1/m]`.
    TimeOfFlight { resolution: f64, depth_unit: f64, inverse: bool },
}

impl Optics {
    /// What distances from the surface are a share of.
    pub(super) fn scale(&self) -> &'static str {
        match self {
            Self::TimeOfFlight { inverse: false, .. } => "longer side",
            _ => "distance",
        }
    }

    /// The error of a value whose trend is known, in the sensor's unit.
    pub(super) fn error(&self, value: f64, trend: f64) -> f64 {
        match self {
            Self::TimeOfFlight { inverse: true, .. } => 1.0 / value - 1.0 / trend,
            _ => value - trend,
        }
    }

    /// How much [`Optics::error`] changes with the value, without its sign.
    pub(super) fn slope(&self, trend: f64) -> f64 {
        match self {
            Self::TimeOfFlight { inverse: true, .. } => 1.0 / (trend * trend),
            _ => 1.0,
        }
    }

    /// The step of what is delivered where the trend is this, in the sensor's unit; of height maps, which say none, a
    /// millionth of their longer side of `pixels`.
    pub(super) fn step(&self, trend: f64, pixels: usize) -> f64 {
        match *self {
            Self::Stereo { focal_length, baseline, depth_unit } => {
                (trend * trend / (focal_length * baseline) * depth_unit).max(LEAST_STEP * trend)
            }
            Self::TimeOfFlight { inverse: true, depth_unit, .. } => {
                depth_unit.max(LEAST_STEP / trend)
            }
            Self::TimeOfFlight { resolution, .. } => LEAST_STEP * resolution * pixels as f64,
        }
    }

    /// How far towards the camera `[m]` a value is that errs by `slope` times `off` from the trend.
    pub(super) fn height(&self, trend: f64, off: f64) -> f64 {
        match *self {
            Self::Stereo { focal_length, baseline, .. } => {
                focal_length * baseline * (1.0 / trend - 1.0 / (trend + off))
            }
            Self::TimeOfFlight { .. } => off,
        }
    }
}

/// Frames of one camera, all of the same size.
#[derive(Debug, Clone, PartialEq)]
pub struct FlatFrames {
    pub(super) optics: Optics,
    pub(super) width: usize,
    pub(super) height: usize,
    /// Values of each frame, row by row; NaN is no data.
    pub(super) values: Vec<Vec<f64>>,
}

impl FlatFrames {
    /// Depth images of a stereo camera whose imagers are `baseline` `[m]` apart and which delivers
    /// depth in steps of `depth_unit` `[m]`.
    ///
    /// # Errors
    /// `TooFewPoints` without an image, `SizeMismatch` for an image of another size than the
    /// camera's, `OutOfRange` for the baseline or the unit.
    pub fn from_stereo(
        images: &[DepthImage],
        camera: &Camera,
        baseline: f64,
        depth_unit: f64,
    ) -> Result<Self, FeatureError> {
        require_in("baseline [m]", baseline, 1e-6, WIDEST_BASELINE)?;
        let focal_length = camera.intrinsics.fx;
        let optics = Optics::Stereo { focal_length, baseline, depth_unit };
        Self::from_depth(images, camera, depth_unit, optics, |z| focal_length * baseline / z)
    }

    /// Depth images of a time-of-flight camera.
    ///
    /// # Errors
    /// As [`FlatFrames::from_stereo`].
    pub fn from_time_of_flight(
        images: &[DepthImage],
        camera: &Camera,
        depth_unit: f64,
    ) -> Result<Self, FeatureError> {
        let mut depths: Vec<f64> = images
            .iter()
            .flat_map(|image| image.depth.iter().copied().filter(|&d| is_valid(d)))
            .map(f64::from)
            .collect();
        let few = FeatureError::TooFewPoints { what: "sensor fit", got: 0, min: 1 };
        let resolution = median(&mut depths).ok_or(few)? / camera.intrinsics.fx;
        let optics = Optics::TimeOfFlight { resolution, depth_unit, inverse: true };
        Self::from_depth(images, camera, depth_unit, optics, |z| 1.0 / z)
    }

    fn from_depth(
        images: &[DepthImage],
        camera: &Camera,
        depth_unit: f64,
        optics: Optics,
        value: impl Fn(f64) -> f64,
    ) -> Result<Self, FeatureError> {
        require_in("depth_unit [m]", depth_unit, 0.0, 1.0)?;
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let mut values = Vec::with_capacity(images.len());
        for image in images {
            image.require_valid()?;
            camera.require_size(image.width, image.height)?;
            let of = |&d: &f32| if is_valid(d) { value(f64::from(d)) } else { f64::NAN };
            values.push(image.depth.iter().map(of).collect());
        }
        Self { optics, width, height, values }.not_empty()
    }

    /// Height maps of one rig.
    ///
    /// # Errors
    /// `TooFewPoints` without a map, `SizeMismatch` for maps of different sizes.
    pub fn from_height_maps(maps: &[HeightMap]) -> Result<Self, FeatureError> {
        let Some(first) = maps.first() else {
            return Err(FeatureError::TooFewPoints { what: "sensor fit", got: 0, min: 1 });
        };
        let expected = (first.width, first.height);
        let mut values = Vec::with_capacity(maps.len());
        for map in maps {
            map.require_valid()?;
            let got = (map.width, map.height);
            if got != expected {
                return Err(FeatureError::SizeMismatch { what: "height map", got, expected });
            }
            let of = |&z: &f64| if z.is_finite() { z } else { f64::NAN };
            values.push(map.z.iter().map(of).collect());
        }
        let optics = Optics::TimeOfFlight {
            resolution: first.resolution_x,
            depth_unit: 0.0,
            inverse: false,
        };
        Self { optics, width: expected.0, height: expected.1, values }.not_empty()
    }

    fn not_empty(self) -> Result<Self, FeatureError> {
        if self.values.is_empty() {
            return Err(FeatureError::TooFewPoints { what: "sensor fit", got: 0, min: 1 });
        }
        Ok(self)
    }

    /// The regions, or the whole frame; refuses one that is not inside.
    pub(super) fn regions(&self, wanted: &[Region]) -> Result<Vec<Region>, FeatureError> {
        if wanted.is_empty() {
            return Ok(vec![Region::whole(self.width, self.height)]);
        }
        for region in wanted {
            region.require_inside(self.width, self.height)?;
        }
        Ok(wanted.to_vec())
    }

    /// The values of a frame in a region, row by row.
    pub(super) fn cut(&self, frame: usize, region: &Region) -> Vec<f64> {
        let rows = self.values[frame].chunks_exact(self.width);
        rows.skip(region.y)
            .take(region.height)
            .flat_map(|row| &row[region.x..region.x + region.width])
            .copied()
            .collect()
    }
}
