//! Functions `paper16` and `statistics_table`.

use granulcal_features::PAPER16;
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::array::Vectors;
use crate::error;

/// The paper's 16 statistics of points, shape (n, 3).
#[pyfunction]
pub(crate) fn paper16<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points = Vectors::borrow("points", points)?;
    let slice = points.as_slice()?;
    let values = py.detach(|| granulcal_features::paper16(slice)).map_err(error::features)?;
    Ok(PyArray1::from_slice(py, &values))
}

/// Name, unit and doc of each statistic, in order.
#[pyfunction]
pub(crate) fn statistics_table() -> Vec<(&'static str, &'static str, &'static str)> {
    PAPER16.iter().map(|statistic| (statistic.name, statistic.unit, statistic.doc)).collect()
}
