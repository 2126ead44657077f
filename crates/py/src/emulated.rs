//! Class `Emulated`.

use std::collections::HashMap;

use granulcal_bayessim::{Array, EmulatorScalars, Misfit, MisfitReference, Tensors};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::array::{self, Rows};
use crate::coordinates::Coordinates;
use crate::error;

/// What arrays that are handed in are called in messages.
const NAME: &str = "the emulator";

/// P-value, joint p-value, that of the scatter, name, residual and p-value of each statistic, and all of it in words.
type Found = (f64, f64, Option<f64>, Vec<(String, f64, f64)>, Option<(usize, f64, f64)>, String);
/// Squared lengths, shape (n,), and residuals, shape (n, s).
type BestFits<'py> = (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray2<f64>>);

/// The emulator of the statistics: its likelihood, and its best fit.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Emulated {
    pub(crate) inner: granulcal_bayessim::Emulated,
}

#[pymethods]
impl Emulated {
    /// Arrays by their names in a model's file.
    #[new]
    #[pyo3(signature = (coordinates, arrays, *, statistics, widening, degrees, leading_degrees, axis_count))]
    #[allow(clippy::too_many_arguments)] // Python's arguments.
    fn new(
        coordinates: &Coordinates,
        arrays: HashMap<String, Bound<'_, PyAny>>,
        statistics: usize,
        widening: f64,
        degrees: f64,
        leading_degrees: f64,
        axis_count: usize,
    ) -> PyResult<Self> {
        let tensors = tensors(arrays)?;
        let scalars = EmulatorScalars { widening, degrees, leading_degrees, axis_count };
        let (space, features) = (&coordinates.inner, None);
        let inner =
            granulcal_bayessim::Emulated::read(&tensors, space, statistics, &scalars, features);
        Ok(Self { inner: inner.map_err(error::model)? })
    }

    /// Log likelihood of pours `z` (k, s) at coordinates `u` (n, p), shape (n,).
    fn log_prob<'py>(
        &self,
        py: Python<'py>,
        z: &Bound<'_, PyAny>,
        u: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (z, u) = (self.pours(z)?, Rows::read("u", u, None)?.0);
        Ok(PyArray1::from_vec(py, py.detach(|| self.inner.log_prob(&z, &u))))
    }

    /// Log likelihood of pours `z` (k, s) at the pool of evenly spread draws of the prior, shape (m,).
    fn at_pool<'py>(
        &self,
        py: Python<'py>,
        z: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let z = self.pours(z)?;
        Ok(PyArray1::from_vec(py, py.detach(|| self.inner.at_pool(&z))))
    }

    /// Means, standard deviations of one pour and of the means there, shape (m, r) each.
    fn expected_at_pool<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyArray2<f64>>>> {
        let (parts, rows) = py.detach(|| (self.inner.expected_at_pool(), self.inner.pool_size()));
        let part = |part: Vec<f64>| {
            let columns = part.len() / rows;
            array::matrix(py, part, rows, columns)
        };
        parts.into_iter().map(part).collect()
    }

    /// Squared length of what the best fit leaves of each of `z` (n, s), and what it leaves of the statistics.
    fn best_fits<'py>(&self, py: Python<'py>, z: &Bound<'_, PyAny>) -> PyResult<BestFits<'py>> {
        let z = self.pours(z)?;
        let (squares, left): (Vec<_>, Vec<_>) =
            py.detach(|| self.inner.best_fits(&z)).into_iter().unzip();
        let left = array::matrix(py, left.concat(), z.len(), self.inner.statistics())?;
        Ok((PyArray1::from_vec(py, squares), left))
    }

    /// Whether any parameters explain `z` (k, s), by residuals of held-out pairs.
    fn misfit(
        &self,
        py: Python<'_>,
        reference: HashMap<String, Bound<'_, PyAny>>,
        z: &Bound<'_, PyAny>,
        names: Vec<String>,
    ) -> PyResult<Found> {
        let reference = MisfitReference::read(&tensors(reference)?, self.inner.statistics());
        let (reference, z) = (reference.map_err(error::model)?, self.pours(z)?);
        let found = py.detach(|| self.inner.misfit(&reference, &z, &names));
        let text = found.to_string();
        let Misfit { p_value, joint_p_value, scatter_p_value, statistics, odd_pour, .. } = found;
        let each = statistics.into_iter().map(|s| (s.name, s.residual, s.p_value)).collect();
        let odd_pour = odd_pour.map(|odd| (odd.number, odd.times, odd.p_value));
        Ok((p_value, joint_p_value, scatter_p_value, each, odd_pour, text))
    }
}

impl Emulated {
    pub(crate) fn pours(&self, z: &Bound<'_, PyAny>) -> PyResult<Vec<Vec<f64>>> {
        Ok(Rows::read("z", z, Some(self.inner.statistics()))?.0)
    }
}

/// Float64 arrays of any shape.
fn tensors(arrays: HashMap<String, Bound<'_, PyAny>>) -> PyResult<Tensors<'static>> {
    let read = |(name, value): (String, Bound<'_, PyAny>)| {
        let (shape, numbers) = array::any_shape(&name, &value)?;
        Ok((name, Array { shape, numbers }))
    };
    let arrays = arrays.into_iter().map(read).collect::<PyResult<_>>()?;
    Ok(Tensors::in_memory(arrays, NAME))
}
