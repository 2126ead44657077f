//! Functions `simulate` and `try_pour`.

use std::time::Duration;

use cpu_time::{ProcessTime, ThreadTime};
use granulcal_dataset::{Observer, Room, Trial};
use granulcal_dem::Simulation;
use pyo3::exceptions::{PyKeyboardInterrupt, PyValueError};
use pyo3::prelude::*;

use crate::error;
use crate::pour::Pour;
use crate::scene::Scene;
use crate::signals::Watch;

/// Simulates a scene to its end. CPU time is the calling thread's, or the process's if more threads help.
#[pyfunction]
pub(crate) fn simulate(py: Python<'_>, scene: &Scene, seed: u64, threads: usize) -> PyResult<Pour> {
    let scene = &scene.inner;
    Room::of_pour(scene, None).require(None).map_err(error::dataset)?;
    let (outcome, interrupted, cpu_seconds) = py.detach(|| {
        let (thread, process) = (ThreadTime::now(), ProcessTime::now());
        let watch = Watch::new();
        let outcome = Simulation::new(scene, seed)
            .and_then(|simulation| simulation.with_threads(threads))
            .and_then(|simulation| simulation.check_start().map(|()| simulation))
            .map(|simulation| {
                let mut observer = Observer::new(scene);
                let pour = observer.run_while(simulation, &|| watch.keep_going(|_| Ok(())))?;
                let (status, observed) = (observer.status(&pour), observer.observed(&pour));
                Some((pour, status, observed))
            });
        let elapsed = if threads == 1 { thread.elapsed() } else { process.elapsed() };
        (outcome, watch.finish(), elapsed.as_secs_f64())
    });
    interrupted?;
    let (pour, status, observed) = outcome.map_err(error::dem)?.ok_or_else(stopped)?;
    let (camera, views) = (scene.camera, scene.views.clone());
    Ok(Pour { inner: pour, status, observed, camera, views, seed, cpu_seconds })
}

/// Pours a scene for about `patience` [s] at most. Returns the processor time of the whole pour [s], extrapolated to its
/// horizon if it was cut short, how far it came [s] and whether it ended.
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
