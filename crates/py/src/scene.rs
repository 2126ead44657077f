//! Class `Scene`.

use std::path::{Path, PathBuf};

use granulcal_dataset::{Limits, Prior, Room};
use granulcal_dem as dem;
use granulcal_features::Formation;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::array::{Numbers, Vectors};
use crate::pour::Pour;
use crate::recording::Recording;
use crate::{array, error, segmentation};

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

    /// What `judge` says of a recording's formation; nothing where the scene cannot begin.
    fn judged(
        &self,
        py: Python<'_>,
        prior_toml: &str,
        recording: &Recording,
        settings: Option<&Bound<'_, PyDict>>,
        judge: fn(&Limits, &granulcal_dataset::Recording, &Formation) -> Vec<String>,
    ) -> PyResult<Vec<String>> {
        let prior = Prior::from_toml(prior_toml).map_err(error::dem)?;
        let own = recording.inner.segmentation.as_seen_by(&self.inner.camera);
        let settings = segmentation::changed(&own, settings)?;
        let found = py.detach(|| {
            let Some(limits) = Limits::of(&self.inner, &prior)? else { return Ok(Vec::new()) };
            let formation = recording.inner.formation_with(&settings);
            formation.map(|formation| judge(&limits, &recording.inner, &formation))
        });
        found.map_err(error::dataset)
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

    /// Number of the law that its pours follow.
    #[getter]
    fn law(&self) -> u32 {
        dem::law_of(&self.inner)
    }

    /// Why what a recording shows cannot be of this scene whose parameters are of a prior, a sentence each; none if it
    /// can, or if that cannot be told. Keywords as `formation` of the recording.
    #[pyo3(signature = (prior_toml, recording, **settings))]
    fn violations(
        &self,
        py: Python<'_>,
        prior_toml: &str,
        recording: &Recording,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Vec<String>> {
        self.judged(py, prior_toml, recording, settings, |limits, _, formation| {
            limits.violations(formation)
        })
    }

    /// What makes it doubtful where it may be of this scene, a sentence each.
    #[pyo3(signature = (prior_toml, recording, **settings))]
    fn doubts(
        &self,
        py: Python<'_>,
        prior_toml: &str,
        recording: &Recording,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Vec<String>> {
        self.judged(py, prior_toml, recording, settings, Limits::doubts_of)
    }

    /// What is said of recordings that are frames of one pour, and not pours of their own.
    fn doubts_of_frames(
        &self,
        py: Python<'_>,
        prior_toml: &str,
        names: Vec<String>,
        recordings: Vec<Py<Recording>>,
    ) -> PyResult<Vec<String>> {
        let prior = Prior::from_toml(prior_toml).map_err(error::dem)?;
        let all: Vec<_> = recordings.iter().map(|each| &each.get().inner).collect();
        let found = py.detach(|| {
            let Some(limits) = Limits::of(&self.inner, &prior)? else { return Ok(Vec::new()) };
            let places: Vec<_> = all.into_iter().map(|each| limits.places_of(each)).collect();
            Ok(limits.doubts_of_frames(&names, &places))
        });
        found.map_err(error::dataset)
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

    /// The scene whose camera has the sensor of a file.
    fn with_sensor(&self, path: PathBuf) -> PyResult<Self> {
        let mut inner = self.inner.clone();
        inner.camera.sensor = Some(granulcal_dataset::load_sensor(&path).map_err(error::dataset)?);
        Self::checked(inner)
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

    /// Centres [m] and radii [m] of the grains when the pour begins.
    #[allow(clippy::type_complexity)] // Python's tuple.
    fn start<'py>(
        &self,
        py: Python<'py>,
        seed: u64,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>)> {
        Room::of_pour(&self.inner, None).require(None).map_err(error::dataset)?;
        let simulation = dem::Simulation::new(&self.inner, seed).map_err(error::dem)?;
        let positions = array::from_vectors(py, &simulation.positions())?;
        Ok((positions, PyArray1::from_slice(py, &simulation.radii())))
    }

    /// Points whose hull every grain is, in the axes of its turn [m], so many on each rim of a cylinder; its centre of
    /// mass where the shape is stated [m], and its axes there, a column each. None of round grains.
    #[allow(clippy::type_complexity)] // Python's tuple.
    fn body<'py>(
        &self,
        py: Python<'py>,
        on_rim: usize,
    ) -> PyResult<
        Option<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>)>,
    > {
        let Some(solid) = self.inner.grains.solid() else { return Ok(None) };
        let vertices = array::from_vectors(py, &solid.vertices(on_rim))?;
        let centre = PyArray1::from_slice(py, solid.centre.as_slice());
        let axes = array::matrix(py, solid.axes.transpose().as_slice().to_vec(), 3, 3)?;
        Ok(Some((vertices, centre, axes)))
    }

    /// The pour of this scene that another simulator has left as spheres at rest.
    fn pour_of(
        &self,
        positions: &Bound<'_, PyAny>,
        radii: &Bound<'_, PyAny>,
        seed: u64,
    ) -> PyResult<Pour> {
        let positions = Vectors::borrow("positions", positions)?;
        let radii = Numbers::borrow("radii", radii)?;
        let (positions, radii) = (positions.as_slice()?.to_vec(), radii.as_slice()?.to_vec());
        let scene = &self.inner;
        let pour = granulcal_dataset::foreign_pour(scene, positions, radii);
        let pour = pour.map_err(error::dataset)?;
        let observer = granulcal_dataset::Observer::new(scene);
        Ok(Pour {
            status: observer.status(&pour),
            observed: observer.observed(&pour),
            masses: pour.radii.iter().map(|&radius| scene.grains.mass_of(radius)).collect(),
            contacts: Err(
                "another simulator leaves its grains alone: no contacts are known".to_owned()
            ),
            inner: pour,
            camera: scene.camera,
            grain_diameter: scene.grains.diameter,
            views: scene.views.clone(),
            seed,
            cpu_seconds: f64::NAN,
        })
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

/// Number of the law that pours of a scene follow today; that of grains of 4 mm and more without one that can be read.
#[pyfunction]
#[pyo3(signature = (scene_toml))]
pub fn law_of(scene_toml: Option<&str>) -> u32 {
    let scene =
        scene_toml.and_then(|text| granulcal_dataset::scene_from_text(text, Path::new("")).ok());
    scene.as_ref().map_or(dem::LAW, dem::law_of)
}
