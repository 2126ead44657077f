//! Class `Scene`.

use std::path::{Path, PathBuf};

use granulcal_dem as dem;
use pyo3::prelude::*;

use crate::error;

/// A scene, checked.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Scene {
    pub(crate) inner: dem::Scene,
}

impl Scene {
    fn checked(inner: dem::Scene) -> PyResult<Self> {
        inner.check().map_err(error::dem)?;
        Ok(Self { inner })
    }
}

#[pymethods]
impl Scene {
    #[staticmethod]
    fn funnel(height: f64) -> PyResult<Self> {
        Self::checked(dem::Scene::funnel(height))
    }

    #[staticmethod]
    fn drop(height: f64) -> PyResult<Self> {
        Self::checked(dem::Scene::drop(height))
    }

    #[staticmethod]
    fn from_toml(text: &str) -> PyResult<Self> {
        let scene = granulcal_dataset::scene_from_text(text, Path::new(""));
        scene.map(|inner| Self { inner }).map_err(error::dataset)
    }

    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let inner = granulcal_dataset::load_scene(&path).map_err(error::dataset)?;
        Ok(Self { inner })
    }

    fn to_toml(&self) -> PyResult<String> {
        self.inner.to_toml().map_err(error::dem)
    }

    fn with_values(&self, values: Vec<(String, f64)>) -> PyResult<Self> {
        let mut inner = self.inner.clone();
        let values: Vec<_> = values.iter().map(|(path, value)| (path.as_str(), *value)).collect();
        inner.set(&values).map_err(error::dem)?;
        Ok(Self { inner })
    }

    fn with_preset(&self, preset: &str) -> PyResult<Self> {
        let preset = preset.parse().map_err(error::dem)?;
        Ok(Self { inner: dem::Scene { preset, ..self.inner.clone() } })
    }

    fn with_name(&self, name: String) -> Self {
        Self { inner: dem::Scene { name, ..self.inner.clone() } }
    }

    fn get(&self, path: &str) -> PyResult<f64> {
        self.inner.get(path).map_err(error::dem)
    }

    /// Name, unit and doc of the statistics that the scene observes.
    fn observed_statistics(&self) -> Vec<(String, &'static str, String)> {
        let all = granulcal_dataset::observed_statistics(&self.inner);
        all.into_iter().map(|statistic| (statistic.name, statistic.unit, statistic.doc)).collect()
    }

    #[getter]
    fn name(&self) -> &str {
        &self.inner.name
    }

    #[getter]
    fn preset(&self) -> &'static str {
        self.inner.preset.name()
    }
}
