//! Class `Formation`.

use numpy::PyArray2;
use pyo3::prelude::*;

use crate::array;

/// The points of a formation and how they were found.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Formation {
    pub(crate) inner: granulcal_features::Formation,
}

#[pymethods]
impl Formation {
    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.points)
    }

    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        array::matrix(py, self.inner.mask.clone(), self.inner.height, self.inner.width)
    }

    #[getter]
    fn normal(&self) -> (f64, f64, f64) {
        let normal = self.inner.plane.plane.normal;
        (normal.x, normal.y, normal.z)
    }

    #[getter]
    fn offset(&self) -> f64 {
        self.inner.plane.plane.offset
    }

    #[getter]
    fn plane_rms(&self) -> f64 {
        self.inner.plane.rms
    }

    #[getter]
    fn plane_inliers(&self) -> usize {
        self.inner.plane.inliers
    }

    #[getter]
    fn tilt_rad(&self) -> f64 {
        self.inner.plane.tilt_rad
    }

    #[getter]
    fn valid_count(&self) -> usize {
        self.inner.valid_count
    }

    #[getter]
    fn threshold(&self) -> f64 {
        self.inner.threshold
    }

    #[getter]
    fn spacing(&self) -> Option<f64> {
        self.inner.spacing()
    }

    #[getter]
    fn centroid(&self) -> (f64, f64) {
        (self.inner.centroid.x, self.inner.centroid.y)
    }
}
