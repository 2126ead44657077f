//! Function `simulate`.

use cpu_time::{ProcessTime, ThreadTime};
use granulcal_dataset::{Observer, Room};
use granulcal_dem::Simulation;
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
    let (pour, status, observed) = outcome.map_err(error::dem)?.ok_or_else(|| {
        pyo3::exceptions::PyKeyboardInterrupt::new_err("the simulation was stopped")
    })?;
    let (camera, views) = (scene.camera, scene.views.clone());
    Ok(Pour { inner: pour, status, observed, camera, views, seed, cpu_seconds })
}
