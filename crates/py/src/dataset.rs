//! Class `Dataset`.

use std::path::PathBuf;

use granulcal_dataset::Row;
use numpy::{Element, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::{array, error};

/// All rows of a data set, column by column.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Dataset {
    inner: granulcal_dataset::Dataset,
}

impl Dataset {
    fn column<'py, T: Element>(
        &self,
        py: Python<'py>,
        value: impl Fn(&Row) -> T,
    ) -> Bound<'py, PyArray1<T>> {
        PyArray1::from_vec(py, self.inner.rows.iter().map(value).collect())
    }
}

#[pymethods]
impl Dataset {
    /// Reads the rows below `rows`, or all.
    #[staticmethod]
    #[pyo3(signature = (path, rows=None))]
    fn open(py: Python<'_>, path: PathBuf, rows: Option<u64>) -> PyResult<Self> {
        let mut inner =
            py.detach(|| granulcal_dataset::Dataset::open(&path)).map_err(error::dataset)?;
        inner.rows.retain(|row| rows.is_none_or(|rows| row.row < rows));
        Ok(Self { inner })
    }

    /// Files that do not say what their rows hash to.
    #[getter]
    fn unverified(&self) -> usize {
        self.inner.unverified.len()
    }

    /// Rows that are missing of those asked for.
    #[getter]
    fn missing(&self) -> u64 {
        self.inner.missing()
    }

    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.inner.write(&path)).map_err(error::dataset)
    }

    fn __len__(&self) -> usize {
        self.inner.rows.len()
    }

    #[getter]
    fn theta_names(&self) -> Vec<&str> {
        self.inner.theta_names()
    }

    #[getter]
    fn theta<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let columns = self.inner.theta_names().len();
        array::matrix(py, self.inner.theta(), self.inner.rows.len(), columns)
    }

    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::matrix(py, self.inner.x(), self.inner.rows.len(), 16)
    }

    #[getter]
    fn diagnostics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let columns = granulcal_dataset::Dataset::diagnostic_names().len();
        array::matrix(py, self.inner.diagnostics(), self.inner.rows.len(), columns)
    }

    #[getter]
    fn observed_names(&self) -> Vec<String> {
        self.inner.observed_statistics().into_iter().map(|statistic| statistic.name).collect()
    }

    #[getter]
    fn observed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let columns = self.inner.observed_statistics().len();
        array::matrix(py, self.inner.observed(), self.inner.rows.len(), columns)
    }

    #[getter]
    fn row<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.column(py, |row| row.row)
    }

    #[getter]
    fn pour_seed<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        self.column(py, |row| row.seed)
    }

    #[getter]
    fn status(&self) -> Vec<&'static str> {
        self.inner.rows.iter().map(|row| row.status.name()).collect()
    }

    #[getter]
    fn health<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = PyDict::new(py);
        let number = |name, value: fn(&Row) -> f64| columns.set_item(name, self.column(py, value));
        number("worst_penetration", |row| row.health.worst_penetration)?;
        number("mean_residual", |row| row.health.mean_residual)?;
        number("worst_residual", |row| row.health.worst_residual)?;
        number("energy_created", |row| row.health.energy_created)?;
        number("mean_contacts", |row| row.health.mean_contacts)?;
        number("simulated_s", |row| row.simulated_s)?;
        number("cpu_s", |row| row.cpu_s)?;
        let count = |name, value: fn(&Row) -> u64| columns.set_item(name, self.column(py, value));
        count("grains_lost", |row| row.health.grains_lost as u64)?;
        count("substeps", |row| row.health.substeps as u64)?;
        count("sweeps", |row| row.health.sweeps as u64)?;
        count("unconverged", |row| row.health.unconverged as u64)?;
        count("guarded", |row| row.health.guarded as u64)?;
        Ok(columns)
    }

    #[getter]
    fn scene_toml(&self) -> PyResult<String> {
        self.inner.header.scene.to_toml().map_err(error::dem)
    }

    #[getter]
    fn prior_toml(&self) -> PyResult<String> {
        self.inner.header.prior.to_toml().map_err(error::dem)
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.inner.header.seed
    }

    /// Number of the solver's law that the rows follow, 0 for another simulator's, None where nobody knows.
    #[getter]
    fn law(&self) -> Option<u32> {
        self.inner.header.law
    }

    /// What must be known of rows of another law than today's, or None.
    #[getter]
    fn other_law(&self) -> Option<String> {
        self.inner.header.other_law()
    }

    #[getter]
    fn version(&self) -> &str {
        &self.inner.header.version
    }
}
