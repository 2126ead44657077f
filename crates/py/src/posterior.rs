//! Class `Posterior`.

use granulcal_bayessim::{Average, Component, Evidence, Form, Identifiability, Mixture, Warning};
use granulcal_dataset::Room;
use nalgebra::{DMatrix, DVector};
use numpy::{PyArray1, PyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::array::{self, Rows};
use crate::coordinates::Coordinates;
use crate::emulated::Emulated;
use crate::error;
use crate::signals::Watch;

/// Points between two looks at signals.
const PART: usize = 1 << 14;

/// Weights (k,), means (k, p) and factors of the precisions (k, p, p).
type MixtureArrays<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);
/// Gains (p,), covariance in spreads of the prior (p, p), effective dimension, ridge (p,), spread along it.
type Known = (Vec<f64>, Vec<Vec<f64>>, f64, Vec<f64>, f64);

/// A normalised density over a prior's coordinates, zero outside the prior's bounds.
#[pyclass(frozen, module = "granulcal._native")]
pub(crate) struct Posterior {
    inner: granulcal_bayessim::Posterior,
    dimension: usize,
}

#[pymethods]
impl Posterior {
    /// Of one material: an emulator and pours (k, s) for each condition, a network's mixture of each pour, and how much
    /// both count: form, weight of the emulator, weight of the network.
    #[new]
    fn new(
        py: Python<'_>,
        coordinates: &Coordinates,
        conditions: Vec<(Py<Emulated>, Bound<'_, PyAny>)>,
        mixtures: Vec<MixtureArrays<'_>>,
        average: (String, f64, f64),
    ) -> PyResult<Self> {
        let space = &coordinates.inner;
        let dimension = space.dimension();
        let (form, emulator, network) = average;
        let form = match form.as_str() {
            "geometric" => Form::Geometric,
            "arithmetic" => Form::Arithmetic,
            other => {
                let message = format!("average must be geometric or arithmetic, got {other}");
                return Err(PyValueError::new_err(message));
            }
        };
        let read = |(emulated, z): &(Py<Emulated>, Bound<'_, PyAny>)| {
            let emulated = emulated.get();
            Ok((emulated.inner.clone(), emulated.pours(z)?))
        };
        let conditions: Vec<_> = conditions.iter().map(read).collect::<PyResult<_>>()?;
        if conditions.is_empty() && mixtures.is_empty() {
            let message = "a posterior needs a condition or a mixture, got none";
            return Err(PyValueError::new_err(message));
        }
        let mixtures =
            mixtures.iter().map(|m| mixture(m, dimension)).collect::<PyResult<Vec<_>>>()?;
        let average = Average { form, emulator, network };
        let evidence = Evidence { conditions, mixtures, average };
        let inner = py.detach(|| granulcal_bayessim::Posterior::of(space, evidence));
        Ok(Self { inner, dimension })
    }

    /// Log density at coordinates `u` (n, p), shape (n,); -inf outside the bounds. Ctrl-C stops it.
    fn log_prob<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let u = Rows::read("u", u, Some(self.dimension))?.0;
        let mut found = Vec::with_capacity(u.len());
        for part in u.chunks(PART) {
            py.check_signals()?;
            let more = py.detach(|| self.inner.coordinate_log_probs(part));
            found.extend(more.map_err(error::model)?);
        }
        Ok(PyArray1::from_vec(py, found))
    }

    /// Draws of the coordinates, shape (n, p). Ctrl-C stops it.
    fn sample<'py>(
        &self,
        py: Python<'py>,
        n: usize,
        seed: u64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Room::of_draws(n, self.dimension).require(None).map_err(error::dataset)?;
        let (draws, stopped) = py.detach(|| {
            let watch = Watch::new();
            let keep_going = || watch.keep_going(|_| Ok(()));
            let draws = self.inner.coordinate_sample_while(n, seed, &keep_going);
            (draws.unwrap_or_default().concat(), watch.finish())
        });
        stopped?;
        array::matrix(py, draws, n, self.dimension)
    }

    /// The coordinates of highest density, shape (p,).
    fn mode<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, py.detach(|| self.inner.coordinate_mode()))
    }

    /// What it knows of the parameters.
    fn identifiability(&self, py: Python<'_>) -> Known {
        let (known, covariance) = py.detach(|| self.inner.knowledge());
        let Identifiability { gains, effective_dimension, ridge, ridge_spread, .. } = known;
        (gains, covariance, effective_dimension, ridge, ridge_spread)
    }

    /// Number of independent draws that the weighted ones are worth; None where no draw is weighted.
    #[getter]
    fn effective_sample_size(&self) -> Option<f64> {
        self.inner.effective_sample_size()
    }

    /// Kind, numbers and words of what to know before trusting it.
    #[getter]
    fn warnings(&self) -> Vec<(&'static str, Vec<f64>, String)> {
        let told = |warning: &Warning| {
            let (kind, numbers) = match *warning {
                Warning::MassOutsidePrior { pour, inside } => {
                    ("mass_outside_prior", vec![pour as f64, inside])
                }
                Warning::FewEffectiveDraws { effective, needed } => {
                    ("few_effective_draws", vec![effective, needed])
                }
                Warning::PoursDisagree { log_evidence_ratio, needed } => {
                    ("pours_disagree", vec![log_evidence_ratio, needed])
                }
                // Of statistics, which are not asked here.
                _ => ("other", Vec::new()),
            };
            (kind, numbers, warning.to_string())
        };
        self.inner.warnings.iter().map(told).collect()
    }
}

fn mixture(arrays: &MixtureArrays<'_>, p: usize) -> PyResult<Mixture> {
    let (weights, means, factors) = arrays;
    let (_, weights) = array::any_shape("weights", weights)?;
    let means = Rows::read("means", means, Some(p))?.0;
    let (shape, factors) = array::any_shape("factors", factors)?;
    let k = weights.len();
    if k == 0 || means.len() != k || shape != [k, p, p] {
        let found = format!("{k} weights, {} means and factors of shape {shape:?}", means.len());
        let message = format!("a mixture needs as many of each, at least one, got {found}");
        return Err(PyValueError::new_err(message));
    }
    let component = |((weight, mean), factor): ((f64, Vec<f64>), &[f64])| Component {
        log_weight: weight.ln(),
        mean: DVector::from_vec(mean),
        factor: DMatrix::from_row_slice(p, p, factor),
    };
    let parts = weights.into_iter().zip(means).zip(factors.chunks_exact(p * p));
    Ok(Mixture::of(parts.map(component).collect()))
}

/// Directions that are known, the one along which least is, and the spread along it, of a covariance in spreads of the
/// prior.
#[pyfunction]
pub(crate) fn directions(covariance: &Bound<'_, PyAny>) -> PyResult<(f64, Vec<f64>, f64)> {
    let rows = Rows::read("covariance", covariance, None)?.0;
    let p = rows.len();
    if p == 0 || rows[0].len() != p {
        return Err(PyValueError::new_err(format!("covariance must be square, got {p} rows")));
    }
    let found = granulcal_bayessim::Directions::of(DMatrix::from_row_slice(p, p, &rows.concat()));
    Ok((found.effective_dimension, found.ridge, found.ridge_spread))
}
