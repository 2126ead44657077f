//! The depth sensor as a scene states it and `fit-sensor` fits it. What it delivers of an image is in
//! `granulcal-features`; equations (1) to (5) of `docs/theory/sensor.md`.

use serde::{Deserialize, Serialize};

use crate::check::within;
use crate::error::SceneError;

/// Largest step of the disparity `[px]` that is accepted.
const MAX_STEP: f64 = 16.0;
/// Largest margin of a hole, and largest correlation length, `[px]` that is accepted.
const MAX_LENGTH: f64 = 1e3;
/// Largest standard deviation that is accepted, px of disparity or metres.
const MAX_SD: f64 = 1e3;

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

/// A stationary Gaussian field, the sum of six independent components.
///
/// The standard deviations have the unit of the sensor's error: px of disparity for a stereo
/// camera, metres for a time-of-flight camera. Lengths are standard deviations of the Gaussian
/// correlation, in pixels of the sensor. The default is no field.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseField {
    /// Standard deviation of what each pixel has of its own.
    pub white: f64,
    /// Standard deviation of the correlated component.
    pub correlated: f64,
    /// Its correlation length along the rows `[px]`.
    pub correlation_x: f64,
    /// Its correlation length along the columns `[px]`.
    pub correlation_y: f64,
    /// Standard deviation of a second, broader correlated component.
    pub broad: f64,
    /// Its correlation length along the rows `[px]`.
    pub broad_x: f64,
    /// Its correlation length along the columns `[px]`.
    pub broad_y: f64,
    /// Standard deviation of what a column has in common.
    pub columns: f64,
    /// Correlation length from column to column `[px]`.
    pub column_correlation: f64,
    /// Standard deviation of what a row has in common.
    pub rows: f64,
    /// Correlation length from row to row `[px]`.
    pub row_correlation: f64,
    /// Height of an alternation from row to row, up in every other one.
    pub row_alternation: f64,
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
    pub fn disparity(&self, depth: f64) -> f64 {
        self.focal_length * self.baseline / depth
    }

    /// The depth `[m]` that a disparity `[px]` with its error is delivered as.
    pub fn deliver(&self, disparity: f64) -> f64 {
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
pub fn round_to(value: f64, step: f64) -> f64 {
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

    /// Serial number of the camera: the seed of its fixed pattern.
    pub fn pattern_seed(&self) -> u64 {
        match self {
            Self::Stereo(sensor) => sensor.pattern_seed,
            Self::TimeOfFlight(sensor) => sensor.pattern_seed,
        }
    }

    /// Incidence from which a surface gives no depth `[deg]`.
    pub fn grazing_deg(&self) -> f64 {
        match self {
            Self::Stereo(sensor) => sensor.grazing_deg,
            Self::TimeOfFlight(sensor) => sensor.grazing_deg,
        }
    }

    /// Refuses numbers that no sensor has; `path` is where the sensor stands, for example `camera.sensor`.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] names the number.
    pub fn check(&self, path: &str) -> Result<(), SceneError> {
        let at = |key: &str| format!("{path}.{key}");
        let (unit, dropout) = match self {
            Self::Stereo(sensor) => {
                within(&at("focal_length"), sensor.focal_length, (1e-3, 1e9), "in [0.001, 1e9]")?;
                within(&at("baseline"), sensor.baseline, (1e-6, 1e3), "in [1e-6, 1000]")?;
                within(&at("quantisation"), sensor.quantisation, (0.0, MAX_STEP), "in [0, 16]")?;
                within(&at("edge_margin"), sensor.edge_margin, (0.0, MAX_LENGTH), "in [0, 1000]")?;
                within(&at("left_margin"), sensor.left_margin, (0.0, MAX_LENGTH), "in [0, 1000]")?;
                (sensor.depth_unit, sensor.dropout)
            }
            Self::TimeOfFlight(sensor) => {
                within(&at("resolution"), sensor.resolution, (1e-9, 1e3), "in [1e-9, 1000]")?;
                (sensor.depth_unit, sensor.dropout)
            }
        };
        within(&at("depth_unit"), unit, (0.0, 1.0), "in [0, 1]")?;
        within(&at("dropout"), dropout, (0.0, 1.0), "in [0, 1]")?;
        within(&at("grazing_deg"), self.grazing_deg(), (0.0, 90.0), "in [0, 90]")?;
        self.noise().check(&at("noise"))?;
        self.fixed_pattern().check(&at("fixed_pattern"))
    }
}

impl NoiseField {
    /// Whether the field is 0 everywhere.
    pub fn is_none(&self) -> bool {
        let sds = [self.white, self.correlated, self.broad, self.columns, self.rows];
        sds.iter().chain([&self.row_alternation]).all(|&sd| sd == 0.0)
    }

    /// Refuses standard deviations and lengths that mean nothing; `path` is where the field stands.
    ///
    /// # Errors
    /// [`SceneError::OutOfRange`] names the number.
    pub fn check(&self, path: &str) -> Result<(), SceneError> {
        for (key, value, max) in [
            ("white", self.white, MAX_SD),
            ("correlated", self.correlated, MAX_SD),
            ("correlation_x", self.correlation_x, MAX_LENGTH),
            ("correlation_y", self.correlation_y, MAX_LENGTH),
            ("broad", self.broad, MAX_SD),
            ("broad_x", self.broad_x, MAX_LENGTH),
            ("broad_y", self.broad_y, MAX_LENGTH),
            ("columns", self.columns, MAX_SD),
            ("column_correlation", self.column_correlation, MAX_LENGTH),
            ("rows", self.rows, MAX_SD),
            ("row_correlation", self.row_correlation, MAX_LENGTH),
            ("row_alternation", self.row_alternation, MAX_SD),
        ] {
            within(&format!("{path}.{key}"), value, (0.0, max), "in [0, 1000]")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::{Projection, Scene, SceneError};

    fn plain() -> String {
        Scene::drop(0.1).to_toml().unwrap()
    }

    const SENSOR: &str = r#"
[camera.sensor]
kind = "stereo"
focal_length = 390.43
baseline = 0.05017
quantisation = 0.03125

[camera.sensor.noise]
correlated = 0.1
correlation_x = 8.0
correlation_y = 6.0
"#;

    #[test]
    fn a_sensor_is_read_set_by_path_and_written() {
        let plain = Scene::drop(0.1).to_toml().unwrap();
        assert!(!plain.contains("sensor"));
        let scene = Scene::from_toml(&format!("{plain}{SENSOR}")).unwrap();
        assert_eq!(Scene::from_toml(&scene.to_toml().unwrap()).unwrap(), scene);
        let path = "camera.sensor.noise.correlated";
        assert_eq!(scene.get(path).unwrap(), 0.1);
        assert_eq!(scene.with(path, 0.2).unwrap().get(path).unwrap(), 0.2);
        // Another scene has no sensor whose noise could be set.
        assert!(Scene::drop(0.1).with(path, 0.2).is_err());
    }

    #[test]
    fn a_stereo_sensor_is_refused_before_an_orthographic_camera_has_poured() {
        let mut scene = Scene::from_toml(&format!("{}{SENSOR}", plain())).unwrap();
        scene.camera.projection = Projection::Orthographic;
        assert_eq!(scene.check(), Err(SceneError::SensorNeedsPinhole));
    }

    #[test]
    fn nonsense_is_named() {
        let plain = Scene::drop(0.1).to_toml().unwrap();
        for (from, to, word) in [
            ("0.05017", "-1.0", "camera.sensor.baseline"),
            ("0.03125", "32.0", "camera.sensor.quantisation"),
            ("8.0", "2000.0", "camera.sensor.noise.correlation_x"),
            ("correlated = 0.1", "correlated = nan", "camera.sensor.noise.correlated"),
            ("quantisation", "quantization", "quantization"),
            ("stereo", "sonar", "sonar"),
        ] {
            let text = format!("{plain}{}", SENSOR.replace(from, to));
            let error = Scene::from_toml(&text).unwrap_err();
            let cause = std::error::Error::source(&error).map(ToString::to_string);
            let said = format!("{error} {}", cause.unwrap_or_default());
            assert!(said.contains(word), "{word}: {said}");
        }
    }
}
