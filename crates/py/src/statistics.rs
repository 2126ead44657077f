//! Functions `paper16`, `diagnostics` and `statistics_table`.

use granulcal_features::stats::{Lift, Rotation};
use granulcal_features::{DIAGNOSTICS, DiagnosticSettings, PAPER16, Statistic};
use nalgebra::Vector2;
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

/// The diagnostic statistics of points, shape (n, 3).
#[pyfunction]
#[pyo3(signature = (points, *, grain_diameter, spacing, pour_axis=None))]
pub(crate) fn diagnostics<'py>(
    py: Python<'py>,
    points: &Bound<'py, PyAny>,
    grain_diameter: f64,
    spacing: f64,
    pour_axis: Option<(f64, f64)>,
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let points = Vectors::borrow("points", points)?;
    let slice = points.as_slice()?;
    let pour_axis = pour_axis.map(|(x, y)| Vector2::new(x, y));
    let settings = DiagnosticSettings { pour_axis, grain_diameter, spacing };
    let values = py.detach(|| granulcal_features::diagnostics(slice, &settings));
    Ok(PyArray1::from_slice(py, &values.map_err(error::features)?))
}

/// Family, name, unit, doc, power of a length, rotation and lift of a statistic.
type Entry = (&'static str, &'static str, &'static str, &'static str, i32, String, &'static str);

/// Every statistic of the registry, in order.
#[pyfunction]
pub(crate) fn statistics_table() -> Vec<Entry> {
    let paper16 = PAPER16.iter().map(|statistic| entry("paper16", statistic));
    paper16.chain(DIAGNOSTICS.iter().map(|statistic| entry("diagnostics", statistic))).collect()
}

fn entry<P>(family: &'static str, statistic: &Statistic<P>) -> Entry {
    let Statistic { name, unit, doc, behaviour, .. } = *statistic;
    let rotation = match behaviour.rotation {
        Rotation::Invariant => "invariant".to_owned(),
        Rotation::Axis => "axis".to_owned(),
        Rotation::Mode { order } => format!("mode {order}"),
    };
    let lift = match behaviour.lift {
        Lift::Invariant => "invariant",
        Lift::Rises => "rises",
        Lift::Changes => "changes",
    };
    (family, name, unit, doc, behaviour.length_power, rotation, lift)
}
