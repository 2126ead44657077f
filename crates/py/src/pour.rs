//! Class `Pour`.

use granulcal_dataset::{Drawn, Observed, RowStatus, Series, View};
use granulcal_dem::Health;
use granulcal_scene::{CameraSpec, ViewSpec};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::contacts::{ContactArrays, Contacts};
use crate::observation::Observation;
use crate::{array, error};

/// Grains at the end of a pour, with the camera that looks at them.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Pour {
    pub(crate) inner: granulcal_dem::Pour,
    pub(crate) status: RowStatus,
    pub(crate) observed: Observed,
    /// Of the grains in the scene [kg].
    pub(crate) masses: Vec<f64>,
    /// Those of the last substep, or why they cannot be told.
    pub(crate) contacts: Result<Contacts, String>,
    pub(crate) camera: CameraSpec,
    /// That the scene states [m].
    pub(crate) grain_diameter: f64,
    pub(crate) views: Vec<ViewSpec>,
    pub(crate) seed: u64,
    pub(crate) cpu_seconds: f64,
}

#[pymethods]
impl Pour {
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.positions)
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.velocities)
    }

    #[getter]
    fn angular_velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.angular_velocities)
    }

    /// Quaternions i, j, k, w of grains that are not round, else none of them.
    #[getter]
    fn orientations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_turns(py, self.inner.convex.as_ref())
    }

    #[getter]
    fn radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.inner.radii)
    }

    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.masses)
    }

    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<ContactArrays<'py>> {
        match &self.contacts {
            Ok(contacts) => contacts.arrays(py),
            Err(reason) => Err(PyValueError::new_err(reason.clone())),
        }
    }

    #[getter]
    fn radii_out<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.inner.radii_out)
    }

    #[getter]
    fn status(&self) -> &'static str {
        self.status.name()
    }

    #[getter]
    fn health<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let Health {
            worst_penetration,
            mean_residual,
            worst_residual,
            energy_created,
            grains_lost,
            substeps,
            sweeps,
            unconverged,
            guarded,
            mean_contacts,
        } = self.inner.health;
        let health = PyDict::new(py);
        health.set_item("worst_penetration", worst_penetration)?;
        health.set_item("mean_residual", mean_residual)?;
        health.set_item("worst_residual", worst_residual)?;
        health.set_item("energy_created", energy_created)?;
        health.set_item("grains_lost", grains_lost)?;
        health.set_item("substeps", substeps)?;
        health.set_item("sweeps", sweeps)?;
        health.set_item("unconverged", unconverged)?;
        health.set_item("guarded", guarded)?;
        health.set_item("mean_contacts", mean_contacts)?;
        Ok(health)
    }

    #[getter]
    fn grains_in_funnel(&self) -> usize {
        self.inner.grains_in_funnel
    }

    #[getter]
    fn state_hash(&self) -> String {
        format!("{:032x}", self.inner.state_hash)
    }

    #[getter]
    fn simulated_s(&self) -> f64 {
        self.inner.simulated_s
    }

    #[getter]
    fn cpu_seconds(&self) -> f64 {
        self.cpu_seconds
    }

    /// Values of the scene's own statistics, in its order.
    #[getter]
    fn observed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.observed.statistics)
    }

    /// What was sampled over time: times and values by name.
    #[getter]
    fn series<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for Series { name, times, values, .. } in &self.observed.series {
            let pair = (PyArray1::from_slice(py, times), PyArray1::from_slice(py, values));
            all.set_item(name, pair)?;
        }
        Ok(all)
    }

    /// Depth image of the view of this name, `None` if the scene has none of it.
    fn look_from<'py>(
        &self,
        py: Python<'py>,
        name: &str,
    ) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let Some(view) = self.views.iter().find(|view| view.name == name) else { return Ok(None) };
        let seen = py.detach(|| granulcal_dataset::capture_from(view, &Drawn::of(&self.inner)));
        match seen.map_err(error::dataset)? {
            View::Depth(_, image) => {
                array::matrix(py, image.depth, image.height, image.width).map(Some)
            }
            View::Heights(_) => unreachable!("a view is a pinhole camera"),
        }
    }

    /// What the scene's camera sees, or one whose lens shows so wide a piece of ground [m].
    #[pyo3(signature = (field_width=None))]
    fn observe(&self, py: Python<'_>, field_width: Option<f64>) -> PyResult<Observation> {
        let field_width = field_width.unwrap_or(self.camera.field_width);
        let camera = CameraSpec { field_width, ..self.camera };
        let seen = py.detach(|| granulcal_dataset::observe(&camera, &self.inner, self.seed));
        let inner = seen.map_err(error::dataset)?.with_grain_diameter(self.grain_diameter);
        Ok(Observation { inner })
    }
}
