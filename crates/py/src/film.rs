//! Function `film`.

use granulcal_dataset::Observer;
use granulcal_dem::{DemError, Simulation};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::scene::Scene;
use crate::signals::Watch;
use crate::{array, error};

/// Simulates a scene to its end and calls `see` with time [s], centres [m] and radii [m] of `rate` frames a simulated
/// second and of the last one.
#[pyfunction]
pub(crate) fn film(
    py: Python<'_>,
    scene: &Scene,
    seed: u64,
    rate: f64,
    see: Py<PyAny>,
) -> PyResult<()> {
    let scene = &scene.inner;
    let start = py.detach(|| -> Result<Simulation, DemError> {
        let simulation = Simulation::new(scene, seed)?;
        simulation.check_start()?;
        Ok(simulation)
    });
    let mut simulation = start.map_err(error::dem)?;
    let mut observer = Observer::new(scene);
    for frame in 1u64.. {
        let positions = array::from_vectors(py, &simulation.positions())?;
        let radii = PyArray1::from_slice(py, &simulation.radii());
        see.call1(py, (simulation.time(), positions, radii))?;
        if simulation.ended().is_some() {
            break;
        }
        let seconds = frame as f64 / rate - simulation.time();
        let (advanced, interrupted) = py.detach(|| {
            let watch = Watch::new();
            let advanced = observer.advance(&mut simulation, seconds);
            watch.keep_going(|_| Ok(()));
            (advanced, watch.finish())
        });
        advanced.map_err(error::dataset)?;
        interrupted?;
    }
    Ok(())
}
