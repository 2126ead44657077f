//! Class `Observation`.

use granulcal_dataset::View;
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::{array, error};

/// A pour as the scene's camera saw it.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Observation {
    pub(crate) inner: granulcal_dataset::Observation,
}

#[pymethods]
impl Observation {
    /// Depth [m], or None when the camera delivers heights.
    #[getter]
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        match &self.inner.view {
            View::Depth(_, image) => {
                array::matrix(py, image.depth.clone(), image.height, image.width).map(Some)
            }
            View::Heights(_) => Ok(None),
        }
    }

    /// Heights [m], or None when the camera delivers depth.
    #[getter]
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        match &self.inner.view {
            View::Heights(map) => array::matrix(py, map.z.clone(), map.height, map.width).map(Some),
            View::Depth(..) => Ok(None),
        }
    }

    #[getter]
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.points)
    }

    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        match &self.inner.statistics {
            Ok(values) => Ok(PyArray1::from_slice(py, values)),
            Err(too_few) => Err(PyValueError::new_err(too_few.to_string())),
        }
    }

    fn diagnostics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        if let Err(too_few) = &self.inner.statistics {
            return Err(PyValueError::new_err(too_few.to_string()));
        }
        let values = self.inner.diagnostics().map_err(error::features)?;
        Ok(PyArray1::from_slice(py, &values))
    }
}
