//! Python bindings: arrays checked, errors translated, the interpreter released; nothing else.
//!
//! `python/granulcal/_native.pyi` lists what is registered here; a test compares the two.

// Arguments from Python are converted for the call and belong to it.
#![allow(clippy::needless_pass_by_value)]

mod array;
mod camera;
mod contacts;
mod coordinates;
mod dataset;
mod discharge;
mod emulated;
mod error;
mod files;
mod formation;
mod gathered;
mod generate;
mod levelled;
mod observation;
mod posterior;
mod pour;
mod prior;
mod recording;
mod run_cli;
mod scene;
mod segmentation;
mod signals;
mod simulate;
mod simulation;
mod statistics;

use pyo3::pymodule;

#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::camera::Camera;
    #[pymodule_export]
    use crate::coordinates::{Coordinates, quasi_uniform};
    #[pymodule_export]
    use crate::dataset::Dataset;
    #[pymodule_export]
    use crate::discharge::discharge_rate;
    #[pymodule_export]
    use crate::emulated::Emulated;
    #[pymodule_export]
    use crate::files::{camera_beside, check_paths, hash_bytes, readable, write_file};
    #[pymodule_export]
    use crate::formation::Formation;
    #[pymodule_export]
    use crate::gathered::GatheredBatch;
    #[pymodule_export]
    use crate::generate::generate;
    #[pymodule_export]
    use crate::levelled::Levelled;
    #[pymodule_export]
    use crate::observation::Observation;
    #[pymodule_export]
    use crate::posterior::{Posterior, directions};
    #[pymodule_export]
    use crate::pour::Pour;
    #[pymodule_export]
    use crate::prior::check_parameter;
    #[pymodule_export]
    use crate::recording::Recording;
    #[pymodule_export]
    use crate::run_cli::{Listener, listen_for_signals, run_cli};
    #[pymodule_export]
    use crate::scene::{Scene, law_of};
    #[pymodule_export]
    use crate::simulate::{simulate, try_pour};
    #[pymodule_export]
    use crate::simulation::Simulation;
    #[pymodule_export]
    use crate::statistics::{diagnostics, paper16, statistics_table};

    /// Number of the law that pours follow.
    #[pymodule_export]
    const LAW: u32 = granulcal_dem::LAW;

    /// Shares between which the rate of a discharge is taken [%].
    #[pymodule_export]
    const DISCHARGE_RANGE: (f64, f64) = granulcal_dataset::DISCHARGE_RANGE;

    /// Factor between the distances of the ground in a recording and in the scene's images, above which the unit of the
    /// depths is asked for.
    #[pymodule_export]
    const UNIT_FACTOR: f64 = granulcal_dataset::UNIT_FACTOR;

    /// Name of the document of a data set's folder.
    #[pymodule_export]
    const MANIFEST: &str = granulcal_dataset::MANIFEST;

    /// How often a right model is called wrong by an observation's misfit.
    #[pymodule_export]
    const SIGNIFICANCE: f64 = granulcal_bayessim::SIGNIFICANCE;

    /// Version of the Rust crates.
    #[pymodule_export]
    #[allow(non_upper_case_globals)] // The name is Python's.
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
