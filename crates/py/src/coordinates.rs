//! Class `Coordinates`.

use std::sync::Arc;

use granulcal_bayessim::QuasiUniform;
use granulcal_scene::Prior;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::array;
use crate::error;

/// The free parameters of a prior, mapped to where the inference lives.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Coordinates {
    pub(crate) inner: Arc<granulcal_bayessim::Coordinates>,
}

#[pymethods]
impl Coordinates {
    #[new]
    fn new(prior_toml: &str) -> PyResult<Self> {
        let prior = Prior::from_toml(prior_toml).map_err(error::dem)?;
        Ok(Self { inner: Arc::new(granulcal_bayessim::Coordinates::of(&prior)) })
    }

    /// Evenly spread draws of the prior, always the same, shape (count, p).
    fn quasi_prior<'py>(
        &self,
        py: Python<'py>,
        count: usize,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let draws = py.detach(|| self.inner.quasi_prior(count).concat());
        array::matrix(py, draws, count, self.inner.dimension())
    }
}

/// Evenly spread points of the unit cube, always the same, shape (count, dimension).
#[pyfunction]
pub(crate) fn quasi_uniform(
    py: Python<'_>,
    count: usize,
    dimension: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let points = QuasiUniform::new(dimension);
    let points = (0..count).flat_map(|index| points.point(index)).collect();
    array::matrix(py, points, count, dimension)
}
