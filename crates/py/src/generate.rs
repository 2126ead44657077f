//! Function `generate`.

use std::path::PathBuf;

use granulcal_dataset::{GenerateOptions, Prior, Progress, Shard};
use pyo3::prelude::*;

use crate::error;
use crate::scene::Scene;
use crate::signals::Watch;

/// Makes the rows that a folder lacks; `progress` is called with (total, resumed, made, unhealthy).
///
/// On Ctrl-C the finished rows are written before KeyboardInterrupt is raised.
#[pyfunction]
#[pyo3(signature = (scene, prior_toml, out, *, rows, seed, threads, resume, progress))]
#[allow(clippy::too_many_arguments)] // Python's keywords.
pub(crate) fn generate(
    py: Python<'_>,
    scene: &Scene,
    prior_toml: &str,
    out: PathBuf,
    rows: u64,
    seed: u64,
    threads: Option<usize>,
    resume: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<(u64, u64, u64, u64)> {
    let prior = Prior::from_toml(prior_toml).map_err(error::dataset)?;
    let default = GenerateOptions::default();
    let threads = threads.unwrap_or(default.threads);
    let options = GenerateOptions { rows, seed, threads, resume, shard: Shard::WHOLE, ..default };
    let scene = &scene.inner;
    let (outcome, interrupted) = py.detach(|| {
        let watch = Watch::new();
        let outcome = granulcal_dataset::generate(scene, &prior, &options, &out, &mut |now| {
            watch.keep_going(|py| match &progress {
                Some(call) => call.call1(py, counts(now)).map(drop),
                None => Ok(()),
            })
        });
        (outcome, watch.finish())
    });
    interrupted?;
    outcome.map(|summary| counts(&summary.progress)).map_err(error::dataset)
}

fn counts(progress: &Progress) -> (u64, u64, u64, u64) {
    (progress.total, progress.resumed, progress.made, progress.unhealthy)
}
