//! Class `Simulation`.

use std::time::Duration;

use cpu_time::{ProcessTime, ThreadTime};
use granulcal_dataset::{Observer, Room, RowStatus};
use granulcal_dem as dem;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::contacts::{ContactArrays, Contacts};
use crate::pour::Pour;
use crate::scene::Scene;
use crate::signals::Watch;
use crate::{array, error};

/// A pour while it goes on.
#[pyclass(module = "granulcal._native")]
pub(crate) struct Simulation {
    inner: dem::Simulation,
    observer: Observer,
    /// How the pour ended, once it has.
    status: Option<RowStatus>,
    /// Whether others than the calling thread work.
    is_shared: bool,
    cpu: Duration,
}

impl Simulation {
    /// The grains of a scene where they start.
    pub(crate) fn begin(
        py: Python<'_>,
        scene: &Scene,
        seed: u64,
        threads: usize,
    ) -> PyResult<Self> {
        let scene = &scene.inner;
        Room::of_pour(scene, None).require(None).map_err(error::dataset)?;
        let is_shared = threads > 1;
        let (inner, cpu) = timed(is_shared, || {
            py.detach(|| -> Result<_, dem::DemError> {
                let simulation = dem::Simulation::new(scene, seed)?.with_threads(threads)?;
                simulation.check_start()?;
                Ok(simulation)
            })
        });
        let inner = inner.map_err(error::dem)?;
        Ok(Self { inner, observer: Observer::new(scene), status: None, is_shared, cpu })
    }
}

/// What a call returns, and its processor time: the calling thread's, or the process's where others help.
fn timed<T>(is_shared: bool, call: impl FnOnce() -> T) -> (T, Duration) {
    let (thread, process) = (ThreadTime::now(), ProcessTime::now());
    let found = call();
    (found, if is_shared { process.elapsed() } else { thread.elapsed() })
}

#[pymethods]
impl Simulation {
    #[new]
    fn new(py: Python<'_>, scene: &Scene, seed: u64, threads: usize) -> PyResult<Self> {
        Self::begin(py, scene, seed, threads)
    }

    /// Simulates to the substep that ends nearest to `time` [s], or less if the pour ends before. A signal stops it
    /// between two substeps.
    pub(crate) fn advance_to(&mut self, py: Python<'_>, time: f64) -> PyResult<()> {
        let Self { inner, observer, is_shared, .. } = self;
        let (interrupted, cpu) = timed(*is_shared, || {
            py.detach(|| {
                let watch = Watch::new();
                observer.advance_while(inner, time, &|| watch.keep_going(|_| Ok(())));
                watch.finish()
            })
        });
        self.cpu += cpu;
        if self.status.is_none() && self.inner.ended().is_some() {
            self.status = Some(self.observer.status(&self.inner.to_pour()));
        }
        interrupted
    }

    /// The state as it is, as a pour.
    pub(crate) fn pour(&self) -> Pour {
        let (inner, scene) = (self.inner.to_pour(), self.inner.scene());
        Pour {
            status: self.observer.status(&inner),
            observed: self.observer.observed(&inner),
            inner,
            masses: self.inner.masses(),
            contacts: Contacts::of(&self.inner).map_err(|reason| reason.to_string()),
            camera: scene.camera,
            grain_diameter: scene.grains.diameter,
            views: scene.views.clone(),
            seed: self.inner.seed(),
            cpu_seconds: self.cpu.as_secs_f64(),
        }
    }

    #[getter]
    fn time(&self) -> f64 {
        self.inner.time()
    }

    /// Length of a substep [s].
    #[getter]
    fn substep(&self) -> f64 {
        self.inner.settings().dt
    }

    #[getter]
    fn status(&self) -> Option<&'static str> {
        self.status.map(RowStatus::name)
    }

    /// The number at the start of the grain in each row.
    #[getter]
    fn numbers<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let numbers = self.inner.numbers().into_iter();
        PyArray1::from_iter(py, numbers.map(|number| number as i64))
    }

    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.positions())
    }

    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.velocities())
    }

    #[getter]
    fn angular_velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_vectors(py, &self.inner.angular_velocities())
    }

    #[getter]
    fn orientations<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        array::from_turns(py, self.inner.convex().as_ref())
    }

    #[getter]
    fn radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.inner.radii())
    }

    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.inner.masses())
    }

    /// Of all grains by their number at the start, also of those that are not in the scene.
    #[getter]
    fn all_radii<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.inner.all_radii())
    }

    #[getter]
    fn all_masses<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.inner.all_masses())
    }

    /// Kinetic and potential energy [J].
    #[getter]
    fn energy(&self) -> (f64, f64) {
        let (energy, mass) = (self.inner.energy(), self.inner.unit_mass());
        (mass * energy.kinetic, mass * energy.potential)
    }

    fn contacts<'py>(&self, py: Python<'py>) -> PyResult<ContactArrays<'py>> {
        Contacts::of(&self.inner).map_err(error::dem)?.arrays(py)
    }

    /// Refuses so many frames of the pour, of all that there is to see, if memory does not hold them.
    fn require_room(&self, every: f64) -> PyResult<()> {
        let grains = self.inner.all_radii().len();
        let room = Room::of_frames(self.inner.scene(), grains, every);
        room.require(None).map_err(error::dataset)
    }
}
