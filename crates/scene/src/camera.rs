//! The depth camera as a scene states it. Rendering belongs to `granulcal-features`; a simulation only needs to know
//! which piece of the ground is in view.

use serde::{Deserialize, Serialize};

use crate::check::{non_negative, within};
use crate::error::SceneError;
use crate::sensor::DepthSensor;

/// Largest blur `[px]` that is accepted: the kernel is 8 sigma wide.
pub const MAX_BLUR: f64 = 1000.0;
/// Largest depth noise `[m]` that is accepted.
pub const MAX_DEPTH_NOISE: f64 = 1e3;
/// Most pixels of a sensor over which a field is drawn.
pub const MAX_SENSOR_PIXELS: f64 = 1e8;
/// Heights and widths of a camera that are accepted `[m]`.
pub(crate) const LENGTHS: (f64, f64) = (1e-6, 1e3);
pub(crate) const IN_LENGTHS: &str = "in [1e-6, 1000]";

/// How the camera projects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Projection {
    /// A pinhole camera looking straight down.
    #[default]
    Pinhole,
    /// A height map with square pixels, as processed recordings are stored.
    Orthographic,
}

/// How the pixels of the grains are told from the ground's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mask {
    /// By the height in the image, noise and all.
    #[default]
    Height,
    /// As colour tells grains from velvet: by what the pixel shows, however wrong its depth is.
    Colour,
}

impl Mask {
    #[allow(clippy::trivially_copy_pass_by_ref)] // serde passes a reference.
    fn is_height(&self) -> bool {
        *self == Self::Height
    }
}

/// A bird's-eye depth camera and how its image becomes grain points.
///
/// The default is the paper's camera: 29 cm above the ground, 58 cm of ground in view, 1920 px, down-sampled by 20.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSpec {
    /// Pinhole or orthographic.
    pub projection: Projection,
    /// Height above the ground `[m]`; unused by an orthographic camera.
    pub height: f64,
    /// Width of the square of ground in view `[m]`.
    pub field_width: f64,
    /// Pixels along a side of the full image.
    pub pixels: usize,
    /// Factor by which the image is down-sampled before statistics are taken.
    pub downsample: usize,
    /// Standard deviation of a Gaussian blur in the image plane, in pixels of the down-sampled image.
    pub blur: f64,
    /// Standard deviation of independent Gaussian noise of depth `[m]`.
    pub depth_noise: f64,
    /// Height above the ground from which a pixel counts as grain `[m]`.
    pub height_threshold: f64,
    /// How grains are told from the ground; with a noisy sensor, by colour.
    #[serde(skip_serializing_if = "Mask::is_height")]
    pub mask: Mask,
    /// What the sensor adds to the image, after blur and depth noise; default nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensor: Option<DepthSensor>,
}

impl Default for CameraSpec {
    fn default() -> Self {
        Self {
            projection: Projection::Pinhole,
            height: 0.29,
            field_width: 0.58,
            pixels: 1920,
            downsample: 20,
            blur: 0.0,
            depth_noise: 0.0,
            height_threshold: 1e-3,
            mask: Mask::Height,
            sensor: None,
        }
    }
}

impl CameraSpec {
    /// Whether a point above `(x, y)` on the ground is in view.
    pub fn sees_ground(&self, x: f64, y: f64) -> bool {
        let half = 0.5 * self.field_width;
        x.abs() <= half && y.abs() <= half
    }

    /// Width of a pixel of the down-sampled image on the ground `[m/px]`.
    pub fn ground_resolution(&self) -> f64 {
        self.field_width / self.pixels as f64 * self.downsample as f64
    }

    /// Refuses a camera that no scene can have.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] and [`SceneError::SensorNeedsPinhole`] name the number.
    pub fn check(&self) -> Result<(), SceneError> {
        within("camera.height", self.height, LENGTHS, IN_LENGTHS)?;
        within("camera.field_width", self.field_width, LENGTHS, IN_LENGTHS)?;
        within("camera.blur", self.blur, (0.0, MAX_BLUR), "in [0, 1000]")?;
        within("camera.depth_noise", self.depth_noise, (0.0, MAX_DEPTH_NOISE), "in [0, 1000]")?;
        non_negative("camera.height_threshold", self.height_threshold)?;
        if self.pixels == 0 || self.pixels > 16_384 {
            return Err(SceneError::range("camera.pixels", self.pixels as f64, "in 1..=16384"));
        }
        if self.downsample == 0 || self.downsample > self.pixels {
            return Err(SceneError::range(
                "camera.downsample",
                self.downsample as f64,
                "in 1..=camera.pixels",
            ));
        }
        self.sensor.map_or(Ok(()), |sensor| self.check_sensor(&sensor))
    }
    /// Checks a sensor, and that this camera can have it.
    fn check_sensor(&self, sensor: &DepthSensor) -> Result<(), SceneError> {
        sensor.check("camera.sensor")?;
        let width = self.ground_resolution();
        // Pixels of the sensor along one of the down-sampled image.
        let scale = match (sensor, self.projection) {
            (DepthSensor::Stereo(_), Projection::Orthographic) => {
                return Err(SceneError::SensorNeedsPinhole);
            }
            (DepthSensor::Stereo(sensor), Projection::Pinhole) => {
                sensor.focal_length * width / self.height
            }
            (DepthSensor::TimeOfFlight(sensor), _) => width / sensor.resolution,
        };
        let side = ((self.pixels / self.downsample) as f64 * scale).ceil();
        within("pixels of camera.sensor", side * side, (1.0, MAX_SENSOR_PIXELS), "in [1, 1e8]")?;
        within("pixels of camera.sensor in one of the image", scale, (1e-6, 1e6), "in [1e-6, 1e6]")
    }
}
