//! Class `Levelled`.

use granulcal_features::PlaneFit;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::array;

/// An image whose ground was found.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Levelled {
    pub(crate) inner: granulcal_features::Levelled,
}

/// Heights [m] as an array, NaN where there is no data.
pub(crate) fn heights<'py>(
    py: Python<'py>,
    heights: &[Option<f64>],
    height: usize,
    width: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let values = heights.iter().map(|z| z.unwrap_or(f64::NAN)).collect();
    array::matrix(py, values, height, width)
}

/// A plane as Python takes it apart: normal, offset [m], tilt [rad], rms [m], inliers.
pub(crate) type PlaneParts = ((f64, f64, f64), f64, f64, f64, usize);

pub(crate) fn plane_parts(fit: &PlaneFit) -> PlaneParts {
    let normal = fit.plane.normal;
    ((normal.x, normal.y, normal.z), fit.plane.offset, fit.tilt_rad, fit.rms, fit.inliers)
}

#[pymethods]
impl Levelled {
    #[getter]
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        heights(py, &self.inner.heights, self.inner.height, self.inner.width)
    }

    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        array::matrix(py, self.inner.mask.clone(), self.inner.height, self.inner.width)
    }

    #[getter]
    fn plane(&self) -> PlaneParts {
        plane_parts(&self.inner.plane)
    }

    #[getter]
    fn ground_sd(&self) -> f64 {
        self.inner.ground_sd
    }

    #[getter]
    fn threshold(&self) -> f64 {
        self.inner.threshold
    }

    #[getter]
    fn valid_count(&self) -> usize {
        self.inner.valid_count
    }

    #[getter]
    fn downsample(&self) -> usize {
        self.inner.downsample
    }

    #[getter]
    fn resolution(&self) -> (f64, f64) {
        self.inner.resolution
    }
}
