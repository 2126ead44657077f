//! Class `Formation`.

use numpy::PyArray2;
use pyo3::prelude::*;

use crate::array;
use crate::levelled::{self, PlaneParts};

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

    /// Heights above the ground [m] of all pixels, NaN where there is no data.
    #[getter]
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        levelled::heights(py, &self.inner.heights, self.inner.height, self.inner.width)
    }

    #[getter]
    fn plane(&self) -> PlaneParts {
        levelled::plane_parts(&self.inner.plane)
    }

    #[getter]
    fn ground_sd(&self) -> f64 {
        self.inner.ground_sd
    }

    #[getter]
    fn volume(&self) -> f64 {
        self.inner.volume
    }

    #[getter]
    fn kind(&self) -> &'static str {
        self.inner.shape.kind.name()
    }

    #[getter]
    fn half_volume_radius(&self) -> f64 {
        self.inner.shape.half_volume_radius
    }

    /// Mean heights in the middle and around it [m].
    #[getter]
    fn profile(&self) -> (f64, f64) {
        (self.inner.shape.inner_height, self.inner.shape.rim_height)
    }

    #[getter]
    fn downsample(&self) -> usize {
        self.inner.downsample
    }

    #[getter]
    fn resolution(&self) -> (f64, f64) {
        self.inner.resolution
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
    fn spacing(&self) -> f64 {
        self.inner.spacing()
    }

    /// Pixels of grain at the edge of the image, apart from the formation, and the frame that holds them [px].
    #[getter]
    fn edge(&self) -> Option<(usize, usize)> {
        self.inner.edge().map(|edge| (edge.count, edge.frame))
    }

    #[getter]
    fn centroid(&self) -> (f64, f64) {
        (self.inner.centroid.x, self.inner.centroid.y)
    }
}
