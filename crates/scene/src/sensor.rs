//! The depth sensor as a scene states it: numbers that the features crate turns into errors of the
//! image. What they mean is derived in `docs/theory/sensor.md`.

use serde::{Deserialize, Serialize};

use crate::check::{non_negative, positive};
use crate::error::DemError;

/// What a depth camera adds to the image; `granulcal-cli fit-sensor` writes it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum SensorSpec {
    /// Errors in px of disparity; depth errors grow with z².
    Stereo(StereoSpec),
    /// Errors in metres: time-of-flight cameras and height maps.
    TimeOfFlight(TimeOfFlightSpec),
}

/// A stereo camera; pixels are those of its own image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StereoSpec {
    /// Focal length `[px]`.
    pub focal_length: f64,
    /// Distance of the imagers `[m]`.
    pub baseline: f64,
    /// Step of the disparity `[px]`; 0 is continuous.
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
    /// Error of the disparity that is new in every pour `[px]`.
    #[serde(default)]
    pub noise: NoiseSpec,
    /// Error of the disparity that is the same in every pour `[px]`.
    #[serde(default)]
    pub fixed_pattern: NoiseSpec,
}

/// A time-of-flight camera or a rig that delivers height maps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeOfFlightSpec {
    /// Width of the ground under one pixel of the sensor `[m/px]`.
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
    /// Error of the depth that is new in every pour `[m]`.
    #[serde(default)]
    pub noise: NoiseSpec,
    /// Error of the depth that is the same in every pour `[m]`.
    #[serde(default)]
    pub fixed_pattern: NoiseSpec,
}

/// A random field over the sensor: standard deviations of its components in the sensor's unit, their
/// correlation lengths in pixels of the sensor. The default is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NoiseSpec {
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

fn default_grazing_deg() -> f64 {
    80.0
}

impl SensorSpec {
    /// The noise and the fixed pattern.
    pub fn fields(&self) -> (&NoiseSpec, &NoiseSpec) {
        match self {
            Self::Stereo(sensor) => (&sensor.noise, &sensor.fixed_pattern),
            Self::TimeOfFlight(sensor) => (&sensor.noise, &sensor.fixed_pattern),
        }
    }

    pub(super) fn check(&self) -> Result<(), DemError> {
        let (grazing, dropout, unit) = match self {
            Self::Stereo(sensor) => {
                positive("camera.sensor.focal_length", sensor.focal_length)?;
                positive("camera.sensor.baseline", sensor.baseline)?;
                non_negative("camera.sensor.quantisation", sensor.quantisation)?;
                non_negative("camera.sensor.edge_margin", sensor.edge_margin)?;
                non_negative("camera.sensor.left_margin", sensor.left_margin)?;
                (sensor.grazing_deg, sensor.dropout, sensor.depth_unit)
            }
            Self::TimeOfFlight(sensor) => {
                positive("camera.sensor.resolution", sensor.resolution)?;
                (sensor.grazing_deg, sensor.dropout, sensor.depth_unit)
            }
        };
        non_negative("camera.sensor.depth_unit", unit)?;
        within("camera.sensor.grazing_deg", grazing, 90.0, "in [0, 90]")?;
        within("camera.sensor.dropout", dropout, 1.0, "in [0, 1]")?;
        let (noise, pattern) = self.fields();
        noise.check("camera.sensor.noise")?;
        pattern.check("camera.sensor.fixed_pattern")
    }
}

impl NoiseSpec {
    fn check(&self, name: &str) -> Result<(), DemError> {
        for (key, value) in [
            ("white", self.white),
            ("correlated", self.correlated),
            ("correlation_x", self.correlation_x),
            ("correlation_y", self.correlation_y),
            ("broad", self.broad),
            ("broad_x", self.broad_x),
            ("broad_y", self.broad_y),
            ("columns", self.columns),
            ("column_correlation", self.column_correlation),
            ("rows", self.rows),
            ("row_correlation", self.row_correlation),
            ("row_alternation", self.row_alternation),
        ] {
            non_negative(&format!("{name}.{key}"), value)?;
        }
        Ok(())
    }
}

fn within(name: &str, got: f64, max: f64, allowed: &'static str) -> Result<(), DemError> {
    if (0.0..=max).contains(&got) { Ok(()) } else { Err(DemError::range(name, got, allowed)) }
}

#[cfg(test)]
mod tests {
    use crate::Scene;

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
    fn nonsense_is_named() {
        let plain = Scene::drop(0.1).to_toml().unwrap();
        for (from, to, word) in [
            ("0.05017", "-1.0", "camera.sensor.baseline"),
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
