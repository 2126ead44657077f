//! A sensor as TOML of its own.

use std::path::Path;

use granulcal_scene::DepthSensor;
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
    sensor: DepthSensor,
}

/// Writes a sensor as the TOML that stands in a scene, `[camera.sensor]`.
///
/// # Errors
/// [`DatasetError::Io`] or [`DatasetError::TomlWrite`].
pub fn save_sensor(path: &Path, sensor: &DepthSensor) -> Result<(), DatasetError> {
    let file = SensorToml { camera: CameraToml { sensor: *sensor } };
    let text = toml::to_string(&file)
        .map_err(|e| DatasetError::TomlWrite { what: "the sensor", source: Box::new(e) })?;
    files::write_file(path, Form::SensorToml, text.as_bytes())
}

/// Reads what [`save_sensor`] wrote.
///
/// # Errors
/// [`DatasetError::Io`], [`DatasetError::Toml`], or [`DatasetError::Sensor`] for numbers that no
/// sensor has.
pub fn load_sensor(path: &Path) -> Result<DepthSensor, DatasetError> {
    let text = files::read_text(path)?;
    let file: SensorToml = toml::from_str(&text)
        .map_err(|source| toml_error(path, "sensor", &text, Box::new(source.into())))?;
    let sensor = file.camera.sensor;
    sensor
        .check("camera.sensor")
        .map_err(|source| DatasetError::Sensor { path: path.to_owned(), source })?;
    Ok(sensor)
}

#[cfg(test)]
mod tests {
    use granulcal_scene::{NoiseField, StereoSensor};

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
        assert_eq!(load_sensor(&path).unwrap(), sensor);
        // Its text is what a scene wants to read after its camera.
        let scene = granulcal_scene::Scene::drop(0.1).to_toml().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let scene = granulcal_scene::Scene::from_toml(&format!("{scene}\n{text}")).unwrap();
        assert_eq!(scene.camera.sensor, Some(sensor));
        std::fs::write(&path, text.replace("dropout = 0.01", "dropout = 2.0")).unwrap();
        assert!(load_sensor(&path).unwrap_err().to_string().contains("sensor.toml"));
        std::fs::write(&path, "[camera]\n").unwrap();
        assert!(matches!(load_sensor(&path), Err(DatasetError::Toml { what: "sensor", .. })));
    }
}
