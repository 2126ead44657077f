//! A sensor as a scene states it, as the features crate applies it, and as TOML of its own.

use std::path::Path;

use granulcal_dem::{NoiseSpec, SensorSpec, StereoSpec, TimeOfFlightSpec};
use granulcal_features::{DepthSensor, NoiseField, StereoSensor, TimeOfFlightSensor};
use serde::{Deserialize, Serialize};

use crate::readable::toml_error;
use crate::{DatasetError, Form, files};

/// The file that `fit-sensor` writes: the tables that belong under a scene's camera.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorToml {
    camera: CameraToml,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraToml {
    sensor: SensorSpec,
}

/// Writes a sensor as the TOML that stands in a scene, `[camera.sensor]`.
///
/// # Errors
/// [`DatasetError::Io`] or [`DatasetError::TomlWrite`].
pub fn save_sensor(path: &Path, sensor: &DepthSensor) -> Result<(), DatasetError> {
    let file = SensorToml { camera: CameraToml { sensor: spec_of(sensor) } };
    let text = toml::to_string(&file)
        .map_err(|e| DatasetError::TomlWrite { what: "the sensor", source: Box::new(e) })?;
    files::write_file(path, Form::SensorToml, text.as_bytes())
}

/// Reads what [`save_sensor`] wrote.
///
/// # Errors
/// [`DatasetError::Io`], [`DatasetError::Toml`], or [`DatasetError::Recording`] for numbers that no
/// sensor has.
pub fn load_sensor(path: &Path) -> Result<SensorSpec, DatasetError> {
    let text = files::read_text(path)?;
    let file: SensorToml = toml::from_str(&text)
        .map_err(|source| toml_error(path, "sensor", &text, Box::new(source)))?;
    let sensor = file.camera.sensor;
    sensor_of(&sensor)
        .require_valid()
        .map_err(|source| DatasetError::Recording { path: path.to_owned(), source })?;
    Ok(sensor)
}

/// The sensor that a scene states.
pub fn sensor_of(spec: &SensorSpec) -> DepthSensor {
    match *spec {
        SensorSpec::Stereo(spec) => {
            let StereoSpec {
                focal_length,
                baseline,
                quantisation,
                depth_unit,
                edge_margin,
                left_margin,
                grazing_deg,
                dropout,
                pattern_seed,
                noise,
                fixed_pattern,
            } = spec;
            DepthSensor::Stereo(StereoSensor {
                focal_length,
                baseline,
                quantisation,
                depth_unit,
                edge_margin,
                left_margin,
                grazing_deg,
                dropout,
                pattern_seed,
                noise: field_of(noise),
                fixed_pattern: field_of(fixed_pattern),
            })
        }
        SensorSpec::TimeOfFlight(spec) => {
            let TimeOfFlightSpec {
                resolution,
                depth_unit,
                grazing_deg,
                dropout,
                pattern_seed,
                noise,
                fixed_pattern,
            } = spec;
            DepthSensor::TimeOfFlight(TimeOfFlightSensor {
                resolution,
                depth_unit,
                grazing_deg,
                dropout,
                pattern_seed,
                noise: field_of(noise),
                fixed_pattern: field_of(fixed_pattern),
            })
        }
    }
}

/// How a scene states a sensor.
pub fn spec_of(sensor: &DepthSensor) -> SensorSpec {
    match *sensor {
        DepthSensor::Stereo(sensor) => {
            let StereoSensor {
                focal_length,
                baseline,
                quantisation,
                depth_unit,
                edge_margin,
                left_margin,
                grazing_deg,
                dropout,
                pattern_seed,
                noise,
                fixed_pattern,
            } = sensor;
            SensorSpec::Stereo(StereoSpec {
                focal_length,
                baseline,
                quantisation,
                depth_unit,
                edge_margin,
                left_margin,
                grazing_deg,
                dropout,
                pattern_seed,
                noise: noise_of(noise),
                fixed_pattern: noise_of(fixed_pattern),
            })
        }
        DepthSensor::TimeOfFlight(sensor) => {
            let TimeOfFlightSensor {
                resolution,
                depth_unit,
                grazing_deg,
                dropout,
                pattern_seed,
                noise,
                fixed_pattern,
            } = sensor;
            SensorSpec::TimeOfFlight(TimeOfFlightSpec {
                resolution,
                depth_unit,
                grazing_deg,
                dropout,
                pattern_seed,
                noise: noise_of(noise),
                fixed_pattern: noise_of(fixed_pattern),
            })
        }
    }
}

/// The two types have the same fields; a field that one of them gains is missed by the compiler here.
macro_rules! same_fields {
    ($function:ident, $from:ident, $to:ident) => {
        fn $function(from: $from) -> $to {
            let $from {
                white,
                correlated,
                correlation_x,
                correlation_y,
                broad,
                broad_x,
                broad_y,
                columns,
                column_correlation,
                rows,
                row_correlation,
                row_alternation,
            } = from;
            $to {
                white,
                correlated,
                correlation_x,
                correlation_y,
                broad,
                broad_x,
                broad_y,
                columns,
                column_correlation,
                rows,
                row_correlation,
                row_alternation,
            }
        }
    };
}

same_fields!(field_of, NoiseSpec, NoiseField);
same_fields!(noise_of, NoiseField, NoiseSpec);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sensor_survives_the_disk_and_stands_in_a_scene() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sensor.toml");
        let sensor = DepthSensor::Stereo(StereoSensor {
            noise: NoiseField { correlated: 0.1, correlation_x: 8.0, ..NoiseField::default() },
            dropout: 0.01,
            ..StereoSensor::new(390.0, 0.05)
        });
        save_sensor(&path, &sensor).unwrap();
        let spec = load_sensor(&path).unwrap();
        assert_eq!(sensor_of(&spec), sensor);
        // Its text is what a scene wants to read after its camera.
        let scene = granulcal_dem::Scene::drop(0.1).to_toml().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let scene = granulcal_dem::Scene::from_toml(&format!("{scene}\n{text}")).unwrap();
        assert_eq!(scene.camera.sensor, Some(spec));
        std::fs::write(&path, text.replace("dropout = 0.01", "dropout = 2.0")).unwrap();
        assert!(load_sensor(&path).unwrap_err().to_string().contains("sensor.toml"));
        std::fs::write(&path, "[camera]\n").unwrap();
        assert!(matches!(load_sensor(&path), Err(DatasetError::Toml { what: "sensor", .. })));
    }
}
