//! Function `discharge_rate`.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::array::Numbers;

/// Slope of the share that has run out [%] against time [s], as the simulated `discharge_rate`; both of shape (n,).
#[pyfunction]
pub(crate) fn discharge_rate(time: &Bound<'_, PyAny>, percent: &Bound<'_, PyAny>) -> PyResult<f64> {
    let (time, percent) = (Numbers::borrow("time", time)?, Numbers::borrow("percent", percent)?);
    let (time, percent) = (time.as_slice()?, percent.as_slice()?);
    if time.len() != percent.len() {
        let (got, expected) = (percent.len(), time.len());
        return Err(PyValueError::new_err(format!(
            "percent must have one number for each of the {expected} of time, got {got}"
        )));
    }
    Ok(granulcal_dataset::discharge_rate(time, percent))
}
