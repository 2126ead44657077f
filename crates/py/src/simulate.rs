//! Functions `simulate` and `try_pour`.

use std::time::Duration;

use granulcal_dataset::Trial;
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;

use crate::error;
use crate::pour::Pour;
use crate::scene::Scene;
use crate::signals::Watch;
use crate::simulation::Simulation;

/// Simulates a scene to its end. CPU time is the calling thread's, or the process's if more threads help.
#[pyfunction]
pub(crate) fn simulate(py: Python<'_>, scene: &Scene, seed: u64, threads: usize) -> PyResult<Pour> {
    let mut simulation = Simulation::begin(py, scene, seed, threads)?;
    simulation.advance_to(py, f64::INFINITY)?;
    Ok(simulation.pour())
}

/// Pours a scene for about `patience` [s] at most. Returns the processor time of the whole pour [s], extrapolated to
/// its horizon if it was cut short, how far it came [s] and whether it ended.
#[pyfunction]
pub(crate) fn try_pour(
    py: Python<'_>,
    scene: &Scene,
    seed: u64,
    patience: f64,
) -> PyResult<(f64, f64, bool)> {
    let patience = Duration::try_from_secs_f64(patience)
        .map_err(|reason| PyValueError::new_err(format!("patience, got {patience}: {reason}")))?;
    let scene = &scene.inner;
    let (outcome, interrupted) = py.detach(|| {
        let watch = Watch::new();
        let keep_going = || watch.keep_going(|_| Ok(()));
        (granulcal_dataset::try_pour(scene, seed, patience, &keep_going), watch.finish())
    });
    interrupted?;
    let Trial { cpu_s, reached_s, has_ended } =
        outcome.map_err(error::dataset)?.ok_or_else(stopped)?;
    Ok((cpu_s, reached_s, has_ended))
}

fn stopped() -> PyErr {
    PyKeyboardInterrupt::new_err("the simulation was stopped")
}
