//! Function `check_parameter`.

use granulcal_scene::{Keys, Parameter};
use pyo3::prelude::*;

use crate::error;

/// Refuses a parameter of a prior that cannot be; what may be stands in `granulcal-scene` alone.
#[pyfunction]
#[pyo3(signature = (path, distribution, *, low=None, high=None, mean=None, sd=None, value=None))]
pub(crate) fn check_parameter(
    path: &str,
    distribution: &str,
    low: Option<f64>,
    high: Option<f64>,
    mean: Option<f64>,
    sd: Option<f64>,
    value: Option<f64>,
) -> PyResult<()> {
    let keys = Keys { low, high, mean, sd, value };
    Parameter::of_keys(path, distribution, keys).map(|_| ()).map_err(error::dem)
}
